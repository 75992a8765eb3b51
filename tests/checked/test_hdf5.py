"""Files of strangers may not lead to other files, nor promise more than they hold."""

import h5py
import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.io.cut_off import open_readable
from surfsup.io.trajectory import Trajectory
from surfsup.io.trajectory_format import GROUP
from tests.evaluation.scenes import SCENE, free_fall, write

NAME = f"{GROUP}/position"


def replace_by(value):
    def change(file, other):
        shape = file[NAME].shape
        del file[NAME]
        value(file, other, shape)

    return change


def virtual(file, other, shape):
    layout = h5py.VirtualLayout(shape, "f4")
    layout[:] = h5py.VirtualSource(other, NAME, shape)
    file[GROUP].create_virtual_dataset("position", layout)


def external(file, other, shape):
    file[GROUP].create_dataset("position", shape, "f4", external=[(str(other), 0, h5py.h5f.UNLIMITED)])


def unwritten(file, other, shape):
    del file[f"{GROUP}/velocity"]
    for name in ("position", "velocity"):
        file[GROUP].create_dataset(name, (10**9, 10**4, 3), "f4", chunks=(1, 100, 3))


FAULTS = {
    "a link to another file": replace_by(
        lambda file, other, shape: file.__setitem__(NAME, h5py.ExternalLink(str(other), NAME))
    ),
    "a link to itself": replace_by(lambda file, other, shape: file.__setitem__(NAME, h5py.SoftLink(f"/{NAME}"))),
    "values in another file": replace_by(external),
    "parts of another file": replace_by(virtual),
    "complex numbers": replace_by(lambda file, other, shape: file.__setitem__(NAME, np.ones(shape, np.complex64))),
    "records": replace_by(lambda file, other, shape: file.__setitem__(NAME, np.ones(shape, [("a", "f4")]))),
    "words": replace_by(lambda file, other, shape: file.__setitem__(NAME, np.full(shape, b"water"))),
    "a shape without values": replace_by(unwritten),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_what_is_not_plain_numbers_in_the_file_itself_is_refused_in_one_line(tmp_path, fault):
    path, other = (write(tmp_path / name, *free_fall(3), scene=SCENE.with_frames(3)) for name in ("a.h5", "other.h5"))
    with h5py.File(path, "r+") as file:
        FAULTS[fault](file, other)
    for opened in (Trajectory, open_readable):
        with pytest.raises(InputError) as error:
            opened(path)
        assert str(error.value).startswith(f"{path}: is not a trajectory of surfsup")
        assert "\n" not in str(error.value)


def test_a_damaged_chunk_is_named_with_its_file(tmp_path):
    path = write(tmp_path / "a.h5", *free_fall(3), scene=SCENE.with_frames(3))
    with h5py.File(path, "r+") as file:
        file[NAME].id.write_direct_chunk((0, 0, 0), b"no deflated values")
    with pytest.raises(InputError, match="is damaged"), Trajectory(path) as trajectory:
        trajectory.positions[:]
