"""Damaged trajectories and data sets: bytes of HDF5, values, types, shapes, links, attributes."""

from __future__ import annotations

import io
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fault_campaign import damage
from fault_campaign.inputs import QUIET, SCENE, Inputs, train_arguments, without_graphics
from fault_campaign.scenes import HOSTILE
from fault_campaign.verdict import Case

Change = Callable[[Any, np.random.Generator], None]
NAMES = ("00000/position", "00000/velocity", "00000/particle_type")


def cases(random: np.random.Generator, count: int, inputs: Inputs) -> Iterator[Case]:
    """Bytes and contents alternate, and so do the verbs."""
    verbs = ("export", "compare", "forces", "restart", "particles", "evaluate", "train", "export")
    changes = list(CHANGES)
    for number in range(count):
        if number % 2:
            name = changes[number // 2 % len(changes)]
            data = changed(inputs.trajectory, CHANGES[name], random)
        else:
            damages = tuple(one for one in damage.ANY if one is not damage.noise)
            one = damages[int(random.integers(len(damages)))]
            name, data = one.__name__, one(inputs.trajectory.read_bytes(), random)
        verb = verbs[number % len(verbs)] if number % 2 else verbs[number // 2 % len(verbs)]
        yield case(verb, f"{verb} {name} {number}", data, inputs)


def case(verb: str, name: str, data: bytes, inputs: Inputs) -> Case:
    """A verb that reads the file."""
    water = ["--frames", 3, "-o", "out", *QUIET]
    arguments: dict[str, list[object]] = {
        "export": ["export", "data/00000.h5", "--to", "npz", "--fps", 200, "-o", "out"],
        "compare": ["compare", "data/00000.h5", "whole.h5"],
        "forces": ["forces", "out/00000.h5"],
        "restart": ["simulate", "scene.yaml", "--restart", "data/00000.h5", *water],
        "particles": ["simulate", "particles.yaml", *water],
        "evaluate": ["evaluate", "dfsph", "data", "--frames", 5, "--no-video", "-o", "out"],
        "train": [*train_arguments(Inputs(Path()), "out"), "steps=2"],
    }
    check = exported_right if verb == "export" else None
    place = "out" if verb == "forces" else "data"  # where the table of forces goes, too
    prepared = partial(prepare, data, inputs, place)
    return Case("trajectory", name, arguments[verb], prepared, check, "00000.h5", without_graphics)


def prepare(data: bytes, inputs: Inputs, place: str, folder: Path) -> None:
    """The damaged file alone in a data set, the undamaged one, and scenes."""
    (folder / place).mkdir()
    (folder / place / "00000.h5").write_bytes(data)
    shutil.copy(inputs.trajectory, folder / "whole.h5")
    (folder / "scene.yaml").write_text(SCENE)
    head = SCENE.partition("fluid:")[0]
    (folder / "particles.yaml").write_text(f"{head}fluid: [{{particles: {{file: data/00000.h5}}}}]\n")


def exported_right(folder: Path) -> str:
    """Whether the exported positions are those of the undamaged file; a changed attribute is no fault."""
    import h5py

    with h5py.File(folder / "whole.h5") as file:
        right = file["00000/position"][:]
    files = sorted((folder / "out").glob("*.npz"))
    for number, path in enumerate(files):
        values = np.load(path)
        key = next(key for key in values if "position" in key)
        if len(files) == len(right) and not np.allclose(values[key], right[number], atol=1e-5):
            return f"frame {number} has other positions"
    return ""


def changed(source: Path, change: Change, random: np.random.Generator) -> bytes:
    """A copy of a trajectory with a change."""
    import h5py

    memory = io.BytesIO(source.read_bytes())
    with h5py.File(memory, "r+") as file:
        change(file, random)
    return memory.getvalue()


def any_name(random: np.random.Generator) -> str:
    """Of a data set."""
    return NAMES[int(random.integers(len(NAMES)))]


def replace(make: Callable[[np.ndarray, np.random.Generator], Any]) -> Change:
    """Another data set in the place of positions or velocities."""

    def change(file: Any, random: np.random.Generator) -> None:
        name = NAMES[int(random.integers(2))]
        values = file[name][:]
        del file[name]
        file[name] = make(values, random)

    return change


def attribute(file: Any, random: np.random.Generator) -> None:
    """A hostile value, or none."""
    names = list(file.attrs)
    name = names[int(random.integers(len(names)))]
    if random.random() < 0.2:
        del file.attrs[name]
        return
    values = [value for value in HOSTILE if isinstance(value, int | float | str) and value != 10**30]
    value = values[int(random.integers(len(values)))]
    file.attrs[name] = value.replace("\x00", "") if isinstance(value, str) else value


def linked(make: Callable[[Any], Any]) -> Change:
    """A link in the place of a data set."""

    def change(file: Any, random: np.random.Generator) -> None:
        name = any_name(random)
        del file[name]
        file[name] = make(name)

    return change


def external_link(name: str) -> Any:
    """A link to another file."""
    import h5py

    return h5py.ExternalLink("whole.h5", name)


def soft_link(name: str) -> Any:
    """A link to itself."""
    import h5py

    return h5py.SoftLink(f"/{name}")


def external_storage(file: Any, random: np.random.Generator) -> None:
    """Values in another file of the user's."""
    name = NAMES[int(random.integers(2))]
    shape = file[name].shape
    del file[name]
    file.create_dataset(name, shape, "f4", external=[("/etc/passwd", 0, 10**9)])


def virtual(file: Any, random: np.random.Generator) -> None:
    """Values that another file has."""
    import h5py

    name = NAMES[int(random.integers(2))]
    shape = file[name].shape
    layout = h5py.VirtualLayout(shape, "f4")
    layout[:] = h5py.VirtualSource("whole.h5", name, shape)
    del file[name]
    file.create_virtual_dataset(name, layout)


def absurd_shape(file: Any, random: np.random.Generator) -> None:
    """More frames than any disk holds, none of them written."""
    for name in NAMES[:2]:
        del file[name]
        shape = (10 ** int(random.integers(6, 10)), 10**4, 3)
        file.create_dataset(name, shape, "f4", chunks=(1, 100, 3))


def cycle(file: Any, random: np.random.Generator) -> None:
    """A group that contains itself."""
    file["00000/pose"] = file["00000"]


def lifetimes(file: Any, random: np.random.Generator) -> None:
    """First and last frames that are none."""
    count = file[NAMES[0]].shape[1]
    kinds = (np.full((count, 2), -5), np.zeros((count, 2), np.int64), np.ones((3, 2), np.int64), np.ones((count, 2)))
    file["00000/lifetime"] = kinds[int(random.integers(len(kinds)))]


def poses(file: Any, random: np.random.Generator) -> None:
    """Poses of a solid that is not there, or that are none."""
    file["00000/pose/surface"] = np.full((24, int(random.integers(6, 9))), random.choice([0.0, np.nan, 1e300]))


def spoiled(values: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Some values are not finite, or huge."""
    values[random.integers(len(values)), random.integers(values.shape[1])] = random.choice([np.nan, np.inf, 1e30])
    return values


CHANGES: dict[str, Change] = {
    "not finite": replace(spoiled),
    "complex": replace(lambda values, random: values.astype(np.complex64)),
    "integers": replace(lambda values, random: values.astype(np.int32)),
    "words": replace(lambda values, random: np.full(values.shape, b"water")),
    "records": replace(lambda values, random: np.ones(values.shape, [("a", "f4")])),
    "references": replace(lambda values, random: np.ones(values.shape, "V8")),
    "two columns": replace(lambda values, random: values[:, :, :2]),
    "one frame": replace(lambda values, random: values[:1]),
    "no frames": replace(lambda values, random: values[:0]),
    "no particles": replace(lambda values, random: values[:, :0]),
    "fewer particles": replace(lambda values, random: values[:, :-1]),
    "no dimension": replace(lambda values, random: np.float32(1)),
    "double": replace(lambda values, random: values.astype(np.float64) * 1e200),
    "attribute": attribute,
    "attribute again": attribute,
    "external link": linked(external_link),
    "link to itself": linked(soft_link),
    "external storage": external_storage,
    "virtual": virtual,
    "absurd shape": absurd_shape,
    "cycle": cycle,
    "lifetimes": lifetimes,
    "poses": poses,
}
