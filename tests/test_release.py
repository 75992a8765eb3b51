"""The notes and checksums of a release: `scripts/release`."""

import hashlib
import importlib.machinery
import importlib.util
import re
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent
NEW = "## Unreleased\n\n- New.\n\n"
CHANGELOG = """# Changelog

## 0.2.0 - 2026-11-01

### Added

- Water.

## [0.1.0] (2026-10-01)

- First.
"""


@pytest.fixture(scope="module")
def release():
    loader = importlib.machinery.SourceFileLoader("release", str(ROOT / "scripts/release"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("release", loader))
    loader.exec_module(module)
    return module


@pytest.mark.parametrize(("version", "text"), [("0.2.0", "### Added\n\n- Water."), ("0.1.0", "- First.")])
def test_the_notes_are_the_section_of_the_version(release, version, text):
    assert release.notes(CHANGELOG, version) == f"# surfsup {version}\n\n{text}\n"


def test_a_new_version_has_the_notes_of_what_is_unreleased(release):
    changelog = CHANGELOG.replace("## 0.2.0", NEW + "## 0.2.0")
    assert release.notes(changelog, "0.3.0") == "# surfsup 0.3.0\n\n- New.\n"
    with pytest.raises(ValueError, match="has unreleased changes"):
        release.notes(changelog, "0.2.0")


def test_without_a_section_there_is_no_release(release):
    with pytest.raises(ValueError, match="no section"):
        release.notes("# Changelog\n", "0.2.0")


def test_the_recipe_for_conda_has_the_version_and_the_dependencies_of_the_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    recipe = yaml.safe_load((ROOT / "packaging/conda/recipe.yaml").read_text())
    assert recipe["context"]["version"] == project["version"]
    names = {"isal": "python-isal", "libigl": "igl", "mapbox-earcut": "mapbox_earcut", "torch": "pytorch"}
    expected = {re.split("[<>=]", one)[0]: one for one in project["dependencies"]}
    found = {one.split()[0]: one.replace(" ", "") for one in recipe["requirements"]["run"][1:]}
    for name, requirement in expected.items():
        other = names.get(name, name)
        assert other in found, name
        assert found[other] == requirement.replace(name, other)


def test_the_checksums_are_those_of_sha256sum(release, tmp_path):
    (tmp_path / "a.whl").write_bytes(b"wheel")
    (tmp_path / "NOTES.md").write_text("notes")
    (tmp_path / "SHA256SUMS").write_text(release.checksums(tmp_path))
    assert hashlib.sha256(b"wheel").hexdigest() in (tmp_path / "SHA256SUMS").read_text()
    subprocess.run(["sha256sum", "--check", "--strict", "SHA256SUMS"], cwd=tmp_path, check=True, capture_output=True)
    assert "SHA256SUMS" not in release.checksums(tmp_path)
