"""Damaged data sets as they come from a stranger: description, records, trajectories, and what is beside them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from fault_campaign import damage
from fault_campaign.inputs import Inputs, generate_arguments, train_arguments, without_graphics
from fault_campaign.kills import unreadable
from fault_campaign.scenes import HOSTILE, at, places
from fault_campaign.verdict import Case

Change = Callable[[Path, np.random.Generator], None]
DESCRIPTION, FIRST, SECOND = "dataset.yaml", "00000.h5", "00001.h5"


def cases(random: np.random.Generator, count: int, inputs: Inputs) -> Iterator[Case]:
    """Every change, for each verb that reads a data set, until there are enough."""
    verbs = ("generate", "evaluate", "train", "generate more", "evaluate", "train", "generate", "floor")
    changes = list(CHANGES)
    for number in range(count):
        verb, name = verbs[number % len(verbs)], changes[number % len(changes)]
        own = np.random.default_rng(random.integers(1 << 62))
        yield case(verb, f"{verb}: {name} {number}", partial(prepare, CHANGES[name], own, inputs))


def case(verb: str, name: str, prepare: Callable[[Path], None]) -> Case:
    """A verb that reads the folder."""
    here = Inputs(Path(), data_folder="out")
    arguments: dict[str, list[object]] = {
        "generate": generate_arguments("out", 2),
        "generate more": generate_arguments("out", 3),
        "evaluate": ["evaluate", "dfsph", "out", "--frames", 5, "--no-video", "-o", "out.evaluation"],
        "train": [*train_arguments(here, "out.run"), "steps=2"],
        "floor": ["floor", "out", "--workers", 1],
    }
    # What was damaged may stay so where it is only read.
    check = partial(whole, "out" if verb.startswith("generate") else "out.*")
    return Case("data set", name, arguments[verb], prepare, check, "out", without_graphics)


def prepare(change: Change, random: np.random.Generator, inputs: Inputs, folder: Path) -> None:
    """A copy of the data set with a change, and a file of the user's that nothing may touch."""
    shutil.copytree(inputs.generated, folder / "out")
    (folder / "secret.h5").write_bytes(inputs.trajectory.read_bytes())
    change(folder / "out", random)


def whole(made: str, folder: Path) -> str:
    """What is wrong with the folders that a run made, and with the file that it may not touch."""
    return next(filter(None, map(unreadable, folder.glob(made))), "")


def description(path: Path, random: np.random.Generator) -> None:
    """A value of the description is hostile, or missing."""
    file = path / DESCRIPTION
    tree = yaml.safe_load(file.read_text())
    everywhere = list(places(tree))
    place = everywhere[int(random.integers(len(everywhere)))] if random.random() < 0.5 else ("recipe",)
    if random.random() < 0.2:
        del at(tree, place[:-1])[place[-1]]
    else:
        at(tree, place[:-1])[place[-1]] = HOSTILE[int(random.integers(len(HOSTILE)))]
    file.write_bytes(yaml.safe_dump(tree, allow_unicode=True).encode("utf-8", "surrogatepass"))


def bytes_of(name: str) -> Change:
    """Any damage to a file's bytes."""

    def change(path: Path, random: np.random.Generator) -> None:
        one = damage.ANY[int(random.integers(len(damage.ANY)))]
        (path / name).write_bytes(one((path / name).read_bytes(), random))

    return change


def instead(name: str, make: Callable[[Path], object]) -> Change:
    """Something else in the place of a file."""

    def change(path: Path, random: np.random.Generator) -> None:
        (path / name).unlink(missing_ok=True)
        make(path / name)

    return change


def record(path: Path, random: np.random.Generator) -> None:
    """A value of the record of a generation is hostile, or missing."""
    import h5py

    with h5py.File(path / FIRST, "r+") as file:
        attributes = file["data_set"].attrs
        names = list(attributes)
        name = names[int(random.integers(len(names)))]
        if random.random() < 0.2:
            del attributes[name]
            return
        value: Any = HOSTILE[int(random.integers(len(HOSTILE)))]
        plain = isinstance(value, int | float) and value != 10**30
        attributes[name] = value if plain else np.array([np.nan, np.inf]) if random.random() < 0.5 else "a\x1b[2Jb"


def record_elsewhere(path: Path, random: np.random.Generator) -> None:
    """The record is a link to another file's."""
    import h5py

    with h5py.File(path / FIRST, "r+") as file:
        del file["data_set"]
        file["data_set"] = h5py.ExternalLink(SECOND, "data_set")


CHANGES: dict[str, Change] = {
    "description": description,
    "description's bytes": bytes_of(DESCRIPTION),
    "record": record,
    "bytes": bytes_of(FIRST),
    "no description": instead(DESCRIPTION, lambda path: None),
    "description of another": instead(DESCRIPTION, lambda path: path.write_text("recipe: chairs\nseed: 0\n")),
    "description is a pipe": instead(DESCRIPTION, os.mkfifo),
    "description is a folder": instead(DESCRIPTION, Path.mkdir),
    "description is a device": instead(DESCRIPTION, lambda path: path.symlink_to("/dev/zero")),
    "description of another file": instead(DESCRIPTION, lambda path: path.symlink_to("/etc/passwd")),
    "description is a loop": instead(DESCRIPTION, lambda path: path.symlink_to(DESCRIPTION)),
    "description without end": instead(DESCRIPTION, lambda path: path.write_bytes(b"[" * 200_000)),
    "records elsewhere": record_elsewhere,
    "trajectory is a pipe": instead(FIRST, os.mkfifo),
    "trajectory is a folder": instead(FIRST, Path.mkdir),
    "trajectory is a device": instead(FIRST, lambda path: path.symlink_to("/dev/zero")),
    "trajectory is a loop": instead(FIRST, lambda path: path.symlink_to(FIRST)),
    "trajectory is empty": instead(FIRST, Path.touch),
    "trajectory is missing": instead(FIRST, lambda path: None),
    "trajectory twice": lambda path, random: shutil.copy(path / SECOND, path / "00005.h5") and None,
    "trajectory that is not generated": lambda path, random: shutil.copy(path / "../secret.h5", path / SECOND) and None,
    "another name": lambda path, random: (path / SECOND).rename(path / "water.h5") and None,
    "lock is a folder": instead(".lock", Path.mkdir),
    "lock is a link": instead(".lock", lambda path: path.symlink_to("../secret.h5")),
    "lock is a pipe": instead(".lock", os.mkfifo),
    "floor is a file": instead("floor", Path.touch),
    "surfaces is a file": instead("surfaces", Path.touch),
    "partial is a folder": instead(".00002.h5.partial", Path.mkdir),
    "no files": lambda path, random: [file.unlink() for file in path.iterdir()] and None,
}
