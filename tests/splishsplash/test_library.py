import ctypes
import sys

import pytest

from surfsup.errors import InputError
from surfsup.splishsplash.library import load_solver


def test_a_missing_opengl_library_is_named_with_its_debian_package(monkeypatch):
    def missing(name, mode=0):
        raise OSError(f"{name}: cannot open shared object file")

    monkeypatch.setattr(ctypes, "CDLL", missing)
    with pytest.raises(InputError, match=r"needs libGLX\.so\.0, which this system lacks: apt-get install libgl1"):
        load_solver()


def test_a_missing_package_is_named_with_the_command_that_installs_it(monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", lambda name, mode=0: None)
    monkeypatch.setitem(sys.modules, "pysplishsplash", None)
    with pytest.raises(InputError, match=r"not installed: pip install 'surfsup\[reference\]'"):
        load_solver()
