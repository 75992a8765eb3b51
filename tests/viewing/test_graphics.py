import ctypes

import pytest

from surfsup.errors import InputError
from surfsup.viewing import graphics


@pytest.fixture(autouse=True)
def clear_cache():
    graphics.require_graphics.cache_clear()
    yield
    graphics.require_graphics.cache_clear()


def test_without_the_loader_both_packages_are_named(monkeypatch):
    def no_library(name: str) -> ctypes.CDLL:
        raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setattr(graphics, "_open_library", no_library)
    monkeypatch.setattr(graphics.sys, "platform", "linux")
    assert graphics.missing_packages() == ["libegl1", "libgl1-mesa-dri"]
    with pytest.raises(InputError, match="apt-get install libegl1 libgl1-mesa-dri") as caught:
        graphics.require_graphics()
    assert "\n" not in str(caught.value)


def test_without_a_driver_only_the_driver_is_named(monkeypatch):
    monkeypatch.setattr(graphics, "_open_library", lambda name: None)
    monkeypatch.setattr(graphics, "_display_starts", lambda egl: False)
    monkeypatch.setattr(graphics.sys, "platform", "linux")
    assert graphics.missing_packages() == ["libgl1-mesa-dri"]


def test_only_linux_is_checked(monkeypatch):
    monkeypatch.setattr(graphics.sys, "platform", "darwin")
    monkeypatch.setattr(graphics, "_open_library", lambda name: pytest.fail("opened a library"))
    assert graphics.missing_packages() == []
