"""Damaged weights, neural surfaces and checkpoints: bytes, tensors, and the values of their headers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fault_campaign import damage
from fault_campaign.inputs import QUIET, Inputs, fit_arguments, train_arguments, without_graphics
from fault_campaign.scenes import HOSTILE, at, places
from fault_campaign.verdict import Case

FILE = "file.safetensors"


def cases(random: np.random.Generator, count: int, inputs: Inputs) -> Iterator[Case]:
    """Weights, surfaces, checkpoints of trainings and of fits; of each, tensors, headers and bytes."""
    files = {"weights": inputs.weights, "surface": inputs.siren, "checkpoint": inputs.checkpoint, "fit": inputs.fit}
    damages = (changed_tensor, changed_header, changed_bytes)
    for number in range(count):
        kind = list(files)[number % len(files)]
        one = damages[number // len(files) % len(damages)]
        name, data = one(files[kind].read_bytes(), random)
        yield case(kind, f"{kind} {name} {number}", data, inputs)


def case(kind: str, name: str, data: bytes, inputs: Inputs) -> Case:
    """What uses the file: a simulation, or a training or a fit that is resumed."""
    water = ["--frames", 3, "-o", "out", *QUIET]
    target = {"checkpoint": "out/checkpoint.safetensors", "fit": "out.fit/checkpoint.safetensors"}.get(kind, FILE)
    arguments: dict[str, list[object]] = {
        "weights": ["simulate", inputs.scene, "--simulator", FILE, *water],
        "surface": ["simulate", FILE, *water],
        "checkpoint": [*train_arguments(inputs, "out"), "--resume"],
        "fit": [*fit_arguments(inputs, "out.safetensors"), "--resume"],
    }
    return Case(
        kind, name, arguments[kind], partial(prepare, target, data), finite, Path(target).name, without_graphics
    )


def prepare(target: str, data: bytes, folder: Path) -> None:
    """Put the file where it is looked for."""
    (folder / target).parent.mkdir(exist_ok=True)
    (folder / target).write_bytes(data)


def finite(folder: Path) -> str:
    """What is wrong with what was made of an accepted file."""
    from surfsup.checked.tensors import read_tensors
    from surfsup.io.trajectory import Trajectory

    for path in folder.rglob("*.safetensors"):
        read_tensors(path)
    for path in folder.rglob("*.h5"):
        with Trajectory(path) as trajectory:
            if not np.isfinite(trajectory.positions[:]).all():
                return f"{path.name} has values that are not finite"
    return ""


def changed_tensor(data: bytes, random: np.random.Generator) -> tuple[str, bytes]:
    """One tensor has other values, another type or another shape, is missing, or is called otherwise."""
    import torch
    from safetensors.torch import load, save

    tensors, header = load(data), header_of(data)
    names = list(tensors)
    name = names[int(random.integers(len(names)))]
    value = tensors.pop(name)
    changes = {
        "NaN": lambda: spoiled(value, float("nan"), random),
        "infinity": lambda: spoiled(value, float("-inf"), random),
        "1e30": lambda: spoiled(value, 1e30, random),
        "all 1e38": lambda: torch.full_like(value.float(), 1e38),
        "zeros": lambda: torch.zeros_like(value),
        "booleans": lambda: value.bool(),
        "integers": lambda: value.nan_to_num().to(torch.int64),
        "bytes": lambda: value.to(torch.uint8),
        "double": lambda: value.double() * 1e300,
        "half": lambda: value.half(),
        "complex": lambda: value.to(torch.complex64),
        "empty": lambda: value.new_zeros((0, *value.shape)),
        "flat": lambda: value.reshape(-1),
        "one more": lambda: torch.cat([value.reshape(-1), value.reshape(-1)[:1]]),
        "another name": lambda: None,
        "missing": lambda: None,
    }
    change = list(changes)[int(random.integers(len(changes)))]
    made = changes[change]()
    if change == "another name":
        tensors[f"{name}\x1b[31m"] = value
    elif made is not None:
        tensors[name] = made.contiguous()
    return f"{name} {change}", save(tensors, header)


def spoiled(value: Any, number: float, random: np.random.Generator) -> Any:
    """A copy with one value replaced."""
    if not value.is_floating_point() or value.numel() == 0:
        return value
    flat = value.reshape(-1).clone()
    flat[int(random.integers(len(flat)))] = number
    return flat.reshape(value.shape)


def changed_header(data: bytes, random: np.random.Generator) -> tuple[str, bytes]:
    """One value of the JSON in the header is a hostile one, or missing."""
    from safetensors.torch import load, save

    header = header_of(data)
    key = list(header)[int(random.integers(len(header)))]
    try:
        tree = json.loads(header[key])
    except ValueError:
        tree = None
    everywhere = list(places(tree)) if isinstance(tree, dict) else []
    if not everywhere or random.random() < 0.1:
        header[key] = str(HOSTILE[int(random.integers(len(HOSTILE)))])
        return key, save(load(data), header)
    path = everywhere[int(random.integers(len(everywhere)))]
    parent = at(tree, path[:-1])
    if random.random() < 0.15:
        del parent[path[-1]]
    else:
        parent[path[-1]] = HOSTILE[int(random.integers(len(HOSTILE)))]
    header[key] = json.dumps(tree)
    return f"{key} {'.'.join(map(str, path))}", save(load(data), header)


def header_of(data: bytes) -> dict[str, str]:
    """The metadata of a safetensors file."""
    length = int.from_bytes(data[:8], "little")
    return json.loads(data[8 : 8 + length])["__metadata__"]


def changed_bytes(data: bytes, random: np.random.Generator) -> tuple[str, bytes]:
    """Damage that knows no format. Flipped bits of a weight cannot be noticed, so only the header is hit."""
    damages = tuple(one for one in damage.ANY if one not in (damage.flip_bits, damage.zero))
    one = damages[int(random.integers(len(damages)))]
    return one.__name__, one(data, random)
