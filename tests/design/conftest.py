import pytest

from surfsup.sph.solver import DfsphSolver


@pytest.fixture(scope="session")
def simulator() -> DfsphSolver:
    return DfsphSolver()
