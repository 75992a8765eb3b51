import h5py
import pytest

from surfsup.datasets.units import UnitMismatchError, check_units
from surfsup.io.trajectory import Trajectory
from tests.evaluation.scenes import free_fall, write


@pytest.mark.parametrize(
    ("unit", "value", "message"),
    [
        ("frame_time", 0.0025, "has a frame every 0.0025 s and particles of radius 0.015 m"),
        ("radius", 0.025, "has a frame every 0.005 s and particles of radius 0.025 m"),
    ],
)
def test_the_error_names_frame_time_and_radius(unit, value, message, tmp_path):
    path = write(tmp_path / "a.h5", *free_fall(2))
    with Trajectory(path) as own:
        check_units(path, own)
    with h5py.File(path, "r+") as file:
        file.attrs[unit] = value
    with Trajectory(path) as other, pytest.raises(UnitMismatchError) as error:
        check_units(path, other)
    assert str(error.value).startswith(f"{path}: ")
    assert message in str(error.value)
    assert "are for 0.005 s and 0.015 m, so take other data" in str(error.value)
