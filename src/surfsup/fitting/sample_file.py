"""The file of a DeepSDF's samples, so that a resumed fit need not draw them again."""

from __future__ import annotations

from pathlib import Path

from surfsup.errors import InputError
from surfsup.fitting.deepsdf_fit import ShapeSamples
from surfsup.sdf.neural import surface_file

NAME = "samples.safetensors"


def save_samples(folder: Path, samples: ShapeSamples) -> None:
    """Write ``samples`` into ``folder``.

    Raises:
        InputError: the disk is full or not writable.
    """
    tensors = {"points": samples.points, "distance": samples.distance}
    surface_file.write(folder / NAME, surface_file.SAMPLES, {"names": samples.names}, tensors)


def load_samples(folder: Path) -> ShapeSamples:
    """Read the samples in ``folder``.

    Raises:
        InputError: they are missing or damaged.
    """
    path = folder / NAME
    header, tensors = surface_file.read(path, surface_file.SAMPLES)
    try:
        return ShapeSamples(header["names"], tensors["points"], tensors["distance"])
    except KeyError as error:
        raise InputError(f"{path}: is damaged ({error} is missing); start the fit again") from None
