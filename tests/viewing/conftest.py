import pytest
import trimesh

from surfsup.viewing.graphics import missing_packages


@pytest.fixture
def ball() -> trimesh.Trimesh:
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.2)
    mesh.apply_translation([0, 0, 0.2])
    return mesh


@pytest.fixture(scope="session")
def off_screen() -> None:
    if missing := missing_packages():
        pytest.skip(f"needs {' '.join(missing)}")
