"""Weights of strangers: what is not a network of plain finite numbers is refused in a line that names the file."""

import json

import pytest
import torch
from safetensors.torch import load_file, save_file

from surfsup.errors import InputError
from surfsup.learned import weights_file
from surfsup.learned.message_passing.architecture import MessagePassingArchitecture
from surfsup.learned.message_passing.surfsup import Surfsup
from surfsup.learned.training_domain import TrainingDomain

DOMAIN = TrainingDomain((1, 1), (2, 2), (9, 9), ("sphere",), (9.81, 9.81), 0.0, 1.0)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "weights.safetensors"
    simulator = Surfsup(MessagePassingArchitecture(width=4, layers=1))
    weights_file.save(path, simulator, weights_file.Card("mine", "about", DOMAIN))
    assert weights_file.load(path)[1].training_domain == DOMAIN
    return path


def change(path, header=None, **tensors):
    from safetensors import safe_open

    with safe_open(path, framework="pt") as opened:
        metadata = dict(opened.metadata())
    for key, values in (header or {}).items():
        metadata[key] = json.dumps(json.loads(metadata[key]) | values)
    save_file(load_file(path) | tensors, path, metadata)


def first(path):
    return next(iter(load_file(path).items()))


@pytest.mark.parametrize("bad", [torch.nan, torch.inf])
def test_numbers_that_are_not_finite(file, bad):
    name, value = first(file)
    change(file, **{name: torch.full_like(value, bad)})
    with pytest.raises(InputError, match=f"weights.safetensors: .*{name}.* not finite"):
        weights_file.load(file)


def test_another_type(file):
    name, value = first(file)
    change(file, **{name: value.bool()})
    with pytest.raises(InputError, match="holds bool instead of float32"):
        weights_file.load(file)


@pytest.mark.parametrize(
    ("key", "values", "reason"),
    [
        ("architecture", {"radius": 1e30}, "radius is 1e"),
        ("architecture", {"radius": 0.0}, "radius is 0.0"),
        ("card", {"name": "../../elsewhere"}, "the card's name"),
        ("card", {"name": "\x1b[2J"}, "the card's name"),
        ("card", {"about": 1}, "the card's text"),
        ("card", {"training_domain": {**DOMAIN.__dict__, "sides": [1, "x"]}}, "sides of the training domain"),
        (
            "card",
            {"training_domain": {**DOMAIN.__dict__, "max_speed": float("nan")}},
            "max_speed of the training domain",
        ),
    ],
)
def test_values_of_the_header(file, key, values, reason):
    change(file, {key: values})
    with pytest.raises(InputError, match=f"weights.safetensors: .*{reason}") as error:
        weights_file.load(file)
    assert "\n" not in str(error.value)
