"""The examples of the public names run as printed."""

import doctest
import inspect
import subprocess
import sys

import pytest

import surfsup

DOCUMENTED = [
    name for name in surfsup.__all__ if not inspect.ismodule(getattr(surfsup, name)) and name != "__version__"
]


@pytest.mark.parametrize("name", DOCUMENTED)
def test_the_example_of_a_public_name_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    value = getattr(surfsup, name)
    examples = doctest.DocTestParser().get_doctest(inspect.getdoc(value) or "", {name: value}, name, None, 0)
    assert examples.examples, f"the docstring of {name} has no example"
    result = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE).run(examples)
    assert result.failed == 0


def test_the_example_of_the_package_runs():
    assert doctest.testmod(surfsup).failed == 0


def test_dir_lists_the_public_names_and_others_do_not_exist():
    assert set(dir(surfsup)) == set(surfsup.__all__)
    with pytest.raises(AttributeError, match="no attribute 'Simulaton'"):
        surfsup.Simulaton  # noqa: B018


def test_importing_the_package_imports_nothing_heavy():
    heavy = ["torch", "numpy", "pyvista", "trimesh", "h5py", "scipy", "pydantic"]
    code = f"import sys, surfsup; print([name for name in {heavy} if name in sys.modules])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert printed.strip() == "[]"


def test_the_package_is_typed():
    from importlib.resources import files

    assert (files("surfsup") / "py.typed").is_file()
