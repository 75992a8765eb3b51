import json
from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from surfsup.errors import InputError
from surfsup.learned import weights_file
from surfsup.learned.registry import LEARNED_SIMULATORS
from tests.learned.message_passing.scenes import MESSAGE_PASSING, ball, make_environment, make_simulator, water

kinds = pytest.mark.parametrize("kind", MESSAGE_PASSING)


def saved(tmp_path: Path, kind: str) -> Path:
    simulator = make_simulator(kind)
    simulator.fit_normalizers([(water(30), 0.01 * torch.randn(30, 3))])
    path = tmp_path / f"{kind}.safetensors"
    weights_file.save(path, simulator, weights_file.Card(kind, "about it"))
    return path


def with_header(path: Path, **changes: str) -> Path:
    with safe_open(path, framework="pt") as file:
        header = file.metadata()
    save_file(load_file(path), path, metadata={**header, **changes})
    return path


@kinds
def test_every_kind_is_restored_with_its_normalizers(kind, tmp_path):
    path = saved(tmp_path, kind)
    loaded, card = weights_file.load(path)
    assert type(loaded) is LEARNED_SIMULATORS[kind]
    assert card.name == kind
    assert loaded.architecture == make_simulator(kind).architecture
    tensors = load_file(path)
    assert {
        f"{name}_normalizer.{value}" for name in ("displacement", "acceleration") for value in ("mean", "std")
    } <= set(tensors)
    assert all(torch.equal(value, tensors[name]) for name, value in loaded.state_dict().items())
    assert torch.isfinite(loaded.step(water(), make_environment(ball()))[0].positions).all()


def test_an_unknown_kind_is_refused_in_one_line(tmp_path):
    path = with_header(saved(tmp_path, "surfsup"), kind="surfsup-9")
    with pytest.raises(InputError, match="kind 'surfsup-9', which this version does not know; known kinds are "):
        weights_file.load(path)


@pytest.mark.parametrize("other", ["corrected", "no-sdf", "value-only", "gns"])
def test_weights_of_one_kind_are_not_loaded_as_another(other, tmp_path):
    path = with_header(saved(tmp_path, "surfsup"), kind=other)
    with pytest.raises(InputError, match="do not fit its architecture"):
        weights_file.load(path)


@pytest.mark.parametrize(
    "changes", [{"width": 9}, {"width": 0}, {"layers": "2"}, {"layers": 3}, {"layers": 10**12}, {"depth": 3}]
)
def test_sizes_that_do_not_fit_are_refused_in_one_line(changes, tmp_path):
    path = saved(tmp_path, "surfsup")
    sizes = {"width": 8, "layers": 2, "radius": 0.1, **changes}
    with pytest.raises(InputError, match="do not fit its architecture") as error:
        weights_file.load(with_header(path, architecture=json.dumps(sizes)))
    assert "\n" not in str(error.value)
