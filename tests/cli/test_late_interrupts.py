import signal
import sys
import time

import pytest

from surfsup.cli.late_interrupts import interrupt_once_more


class Fragile:
    def __init__(self, error):
        self.error = error

    def __del__(self):
        raise self.error


@pytest.fixture
def handled_interrupts():
    """Interrupts as a terminal has them; a program in the background would ignore them."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("handled_interrupts")
def test_an_interrupt_in_a_destructor_comes_a_moment_later(monkeypatch, capsys):
    monkeypatch.setattr(sys, "unraisablehook", interrupt_once_more)
    with pytest.raises(KeyboardInterrupt):
        Fragile(KeyboardInterrupt())
        time.sleep(1)
    assert capsys.readouterr().err == ""


def test_another_error_in_a_destructor_is_printed(monkeypatch, capsys):
    monkeypatch.setattr(sys, "unraisablehook", interrupt_once_more)
    Fragile(ValueError("spoiled"))
    assert "ValueError: spoiled" in capsys.readouterr().err
