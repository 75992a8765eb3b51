import pytest


@pytest.fixture(scope="session")
def map_folder(tmp_path_factory):
    """Boundary maps that the tests of a session share, so that each container is mapped once."""
    return tmp_path_factory.mktemp("maps")
