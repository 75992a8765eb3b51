"""Trained weights as safetensors: tensors and a JSON header, no code."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from surfsup.checked.tensors import load_weights, plain_text, read_tensors
from surfsup.errors import InputError
from surfsup.learned.base import Architecture, LearnedSimulator
from surfsup.learned.message_passing.simulator import MessagePassingSimulator
from surfsup.learned.registry import LEARNED_SIMULATORS
from surfsup.learned.simulator_names import shipped
from surfsup.learned.training_domain import TrainingDomain

FORMAT = "surfsup-simulator-6"
FORMAT_5 = "surfsup-simulator-5"  # message-passing simulators with node features of version 1
MAX_NAME = 100  # characters
FORMAT_FAMILY = "surfsup-simulator-"


@dataclass(frozen=True)
class Card:
    """The description of a set of weights.

    Attributes:
        name: of the model.
        about: data, seeds, command, time and scores, as plain text.
        training_domain: the range of the training data; None if it is not known.
    """

    name: str
    about: str
    training_domain: TrainingDomain | None = None

    @classmethod
    def from_json(cls, data: Any) -> Card:
        """The card from its JSON.

        Raises:
            TypeError: it is not a mapping, or a key is missing or unknown.
            ValueError: a value is of another type.
        """
        if not isinstance(data, dict):
            raise TypeError(f"a card is a mapping, not {data!r}")
        domain = data.get("training_domain")
        name = plain_text("the card's name", data.get("name"), MAX_NAME)
        if not name.isprintable() or "/" in name or name.startswith("."):  # it becomes the name of a folder
            raise ValueError(f"the card's name is {name!r}")
        plain_text("the card's text", data.get("about"))
        return cls(**{**data, "training_domain": None if domain is None else TrainingDomain.from_json(domain)})


def save(path: Path, simulator: LearnedSimulator, card: Card) -> None:
    """Write the weights and their card to ``path``. An existing file is replaced only once all is written."""
    header = {
        "format": FORMAT,
        "kind": simulator.kind,
        "architecture": json.dumps(asdict(simulator.architecture)),
        "card": json.dumps(asdict(card)),
    }
    partial = path.with_name(path.name + ".partial")
    save_file(simulator.state_dict(), partial, metadata=header)
    partial.replace(path)


def load(path: Path) -> tuple[LearnedSimulator[Any], Card]:
    """The simulator with the weights in ``path``, ready for rollouts, and its card.

    Raises:
        InputError: the file is missing, truncated, not safetensors, of another format version, of an unknown kind, or
            its tensors do not fit its architecture.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such weights file")
    try:
        with safe_open(path, framework="pt") as file:
            header = file.metadata() or {}
            check_format(path, header.get("format"))
            kind = LEARNED_SIMULATORS.get(header["kind"])
            if kind is None:
                raise InputError(
                    f"{path}: contains weights of kind '{header['kind']}', which this version does not know; "
                    f"known kinds are {', '.join(LEARNED_SIMULATORS)}"
                )
        tensors = read_tensors(path)
        sizes = json.loads(header["architecture"])
        if header["format"] == FORMAT_5 and issubclass(kind, MessagePassingSimulator):
            sizes |= {"features": 1}
        architecture = kind.architecture_type(**sizes)
        check_sizes(architecture, tensors)
        simulator = kind(architecture)
        load_weights(simulator, tensors)
        card = Card.from_json(json.loads(header["card"]))
    except SafetensorError as error:
        raise InputError(
            f"{path}: is truncated or not a safetensors file ({error}); pickled weights are refused"
        ) from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (KeyError, TypeError, ValueError, RuntimeError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        reason = " ".join(str(error).split())
        raise InputError(
            f"{path}: its tensors do not fit its architecture ({reason[:120]}); if another version of surfsup wrote "
            f"it, train the model again"
        ) from None
    return simulator.eval().requires_grad_(False), card


def check_format(path: Path, found: str | None) -> None:
    """Check the format in a file's header.

    Raises:
        InputError: it is another one; for weights of another version the message says what to do.
    """
    if found in (FORMAT, FORMAT_5):
        return
    if found is not None and found.startswith(FORMAT_FAMILY):
        raise InputError(
            f"{path}: is weights format '{found}' of another version of surfsup, this version reads '{FORMAT}'; "
            f"train the model again with 'surfsup train', or install the version that wrote it"
        )
    raise InputError(f"{path}: contains '{found or 'something else'}', not weights of a simulator ('{FORMAT}')")


def check_sizes(architecture: Architecture, tensors: dict[str, Tensor]) -> None:
    """Check the sizes against the tensors, before a network of absurd size takes all memory.

    Raises:
        ValueError: a size does not fit; the message names it.
    """
    largest = max((size for tensor in tensors.values() for size in tensor.shape), default=0)
    if not isinstance(architecture.width, int) or not 0 < architecture.width <= largest:
        raise ValueError(f"width is {architecture.width!r}")
    if not isinstance(architecture.layers, int) or not 0 < architecture.layers <= len(tensors):
        raise ValueError(f"layers is {architecture.layers!r}")


def find(name: str) -> Path:
    """The weights file of a shipped model, or the file with this path.

    Raises:
        InputError: there is neither.
    """
    models = shipped()
    if name in models:
        return models[name]
    path = Path(name)
    if path.is_file():
        return path
    raise InputError(f"there are no weights '{name}'; shipped are {', '.join(models)}, or give a .safetensors file")
