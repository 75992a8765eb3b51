"""Trained weights as safetensors: tensors and a JSON header, nothing that could run."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from surfsup.errors import InputError
from surfsup.learned.registry import KINDS
from surfsup.learned.training_domain import TrainingDomain
from surfsup.sph.simulator import Simulator, Sizes

FORMAT = "surfsup-simulator-4"
DEFAULT_MODEL = "fast"


@dataclass(frozen=True)
class Card:
    """What is known of a set of weights.

    Attributes:
        name: of the model.
        about: data, seeds, command, time and scores, as plain text.
        seen: what the training data were like, where that is known.
    """

    name: str
    about: str
    seen: TrainingDomain | None = None

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Card:
        """The card that was written as JSON.

        Raises:
            TypeError: a key is missing or unknown.
        """
        if not isinstance(data, dict):
            raise TypeError(f"a card is a mapping, not {data!r}")
        seen = data.get("seen")
        return cls(**{**data, "seen": None if seen is None else TrainingDomain.from_json(seen)})


def save(path: Path, simulator: Simulator, card: Card) -> None:
    """Write the weights and their card to ``path``; one that is there is replaced when all is written."""
    header = {
        "format": FORMAT,
        "kind": simulator.kind,
        "architecture": json.dumps(asdict(simulator.architecture)),
        "card": json.dumps(asdict(card)),
    }
    partial = path.with_name(path.name + ".partial")
    save_file(simulator.state_dict(), partial, metadata=header)
    partial.replace(path)


def load(path: Path) -> tuple[Simulator, Card]:
    """The simulator whose weights are in ``path``, ready to roll out, and its card.

    Raises:
        InputError: the file is missing, cut off, not safetensors, of a kind that is not known here, or of another
            architecture.
    """
    if not path.is_file():
        raise InputError(f"{path}: there is no such weights file")
    try:
        with safe_open(path, framework="pt") as file:
            header = file.metadata() or {}
            if header.get("format") != FORMAT:
                raise InputError(
                    f"{path}: holds '{header.get('format', 'something else')}', not weights of a simulator "
                    f"of this version ('{FORMAT}')"
                )
            kind = KINDS.get(header["kind"])
            if kind is None:
                raise InputError(
                    f"{path}: is of a simulator of kind '{header['kind']}', which this version does not know; "
                    f"it knows {', '.join(KINDS)}"
                )
            names = file.keys()  # the file itself is no mapping
            tensors = {name: file.get_tensor(name) for name in names}
        architecture = kind.architecture_type(**json.loads(header["architecture"]))
        check_sizes(architecture, tensors)
        simulator = kind(architecture)
        simulator.load_state_dict(tensors)
        card = Card.from_json(json.loads(header["card"]))
    except SafetensorError as error:
        raise InputError(
            f"{path}: is cut off or not a safetensors file ({error}); pickled weights are refused"
        ) from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        if isinstance(error, InputError):
            raise
        reason = " ".join(str(error).split())
        raise InputError(
            f"{path}: its tensors do not fit its architecture ({reason[:120]}); if another version of surfsup made it, "
            f"train it anew"
        ) from None
    return simulator.eval().requires_grad_(False), card


def check_sizes(architecture: Sizes, tensors: dict[str, Tensor]) -> None:
    """Refuse sizes that the tensors cannot fill before a network of those sizes takes all memory.

    Raises:
        ValueError: naming the size.
    """
    widest = max((size for tensor in tensors.values() for size in tensor.shape), default=0)
    if not isinstance(architecture.width, int) or not 0 < architecture.width <= widest:
        raise ValueError(f"width is {architecture.width!r}")
    if not isinstance(architecture.layers, int) or not 0 < architecture.layers <= len(tensors):
        raise ValueError(f"layers is {architecture.layers!r}")
    if not isinstance(architecture.radius, float) or not 0 < architecture.radius < math.inf:
        raise ValueError(f"radius is {architecture.radius!r}")


def shipped() -> dict[str, Path]:
    """The models that come with the package, by name."""
    folder = Path(str(files("surfsup.weights")))
    return {path.stem: path for path in sorted(folder.glob("*.safetensors"))}


def find(model: str) -> Path:
    """The weights file of a shipped model's name, or the file that ``model`` is the path of.

    Raises:
        InputError: neither.
    """
    models = shipped()
    if model in models:
        return models[model]
    path = Path(model)
    if path.is_file():
        return path
    raise InputError(f"there is no model '{model}'; shipped are {', '.join(models)}, or give a .safetensors file")
