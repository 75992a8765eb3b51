import json
from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from surfsup.errors import InputError
from surfsup.learned import weights_file
from surfsup.learned.registry import KINDS
from tests.learned.message_passing.scenes import PAPERS, around, ball, simulator, water

kinds = pytest.mark.parametrize("kind", PAPERS)


def saved(tmp_path: Path, kind: str) -> Path:
    made = simulator(kind)
    made.measure([(water(30), 0.01 * torch.randn(30, 3), torch.randn(30, 3))])
    path = tmp_path / f"{kind}.safetensors"
    weights_file.save(path, made, weights_file.Card(kind, "about it"))
    return path


def with_header(path: Path, **changes: str) -> Path:
    with safe_open(path, framework="pt") as file:
        header = file.metadata()
    save_file(load_file(path), path, metadata={**header, **changes})
    return path


@kinds
def test_every_kind_comes_back_as_itself_with_its_normalization(kind, tmp_path):
    path = saved(tmp_path, kind)
    loaded, card = weights_file.load(path)
    assert type(loaded) is KINDS[kind]
    assert card.name == kind
    assert loaded.architecture == simulator(kind).architecture
    tensors = load_file(path)
    assert {"moves.mean", "moves.spread", "accelerations.mean", "accelerations.spread"} <= set(tensors)
    assert all(torch.equal(value, tensors[name]) for name, value in loaded.state_dict().items())
    assert torch.isfinite(loaded.step(water(), around(ball()))[0].positions).all()


def test_a_kind_that_is_not_known_is_one_line(tmp_path):
    path = with_header(saved(tmp_path, "surfsup"), kind="surfsup-9")
    with pytest.raises(InputError, match="kind 'surfsup-9', which this version does not know; it knows convolution, "):
        weights_file.load(path)


@pytest.mark.parametrize("other", ["convolution", "no-sdf", "value-only", "gns"])
def test_weights_of_one_kind_are_not_taken_for_another(other, tmp_path):
    path = with_header(saved(tmp_path, "surfsup"), kind=other)
    with pytest.raises(InputError, match="do not fit its architecture"):
        weights_file.load(path)


@pytest.mark.parametrize(
    "changes", [{"history": 5}, {"history": 0}, {"stride": "1"}, {"stride": 10**9}, {"layers": 10**12}, {"depth": 3}]
)
def test_sizes_that_do_not_fit_are_one_line(changes, tmp_path):
    path = saved(tmp_path, "surfsup")
    sizes = {"width": 8, "layers": 2, "radius": 0.1, "history": 4, "stride": 1, **changes}
    with pytest.raises(InputError, match="do not fit its architecture") as error:
        weights_file.load(with_header(path, architecture=json.dumps(sizes)))
    assert "\n" not in str(error.value)
