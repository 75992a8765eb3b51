"""Tensors of strangers have the types of the network and are finite, or are refused by name."""

import pytest
import torch
from safetensors.torch import save_file
from torch import nn

from surfsup.checked.tensors import finite_number, load_weights, plain_text, read_tensors, whole_number


@pytest.mark.parametrize(
    ("tensor", "reason"),
    [
        (torch.tensor([1.0, torch.nan]), "not finite"),
        (torch.tensor([torch.inf]), "not finite"),
        (torch.ones(2, dtype=torch.complex64), "complex numbers"),
    ],
)
def test_numbers_that_are_not_finite_are_refused(tmp_path, tensor, reason):
    save_file({"weight": tensor}, tmp_path / "a.safetensors")
    with pytest.raises(ValueError, match=f"its tensor 'weight' .*{reason}"):
        read_tensors(tmp_path / "a.safetensors")


def test_tensors_begin_where_those_of_torch_begin(tmp_path):
    save_file({"a": torch.ones(3, dtype=torch.uint8), "b": torch.rand(64, 64)}, tmp_path / "a.safetensors")
    assert all(tensor.data_ptr() % 64 == 0 for tensor in read_tensors(tmp_path / "a.safetensors").values())


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"weight": torch.ones(2, 3, dtype=torch.bool)}, "holds bool instead of float32"),
        ({"weight": torch.ones(2, 3, dtype=torch.int32)}, "holds int32 instead of float32"),
        ({"weight": torch.full((2, 3), 1e300, dtype=torch.float64)}, "too large for float32"),
        ({"weight": torch.ones(3, 2)}, r"has the shape \(3, 2\) instead of \(2, 3\)"),
        ({"other": torch.ones(1)}, "its tensor 'other' is unknown"),
        ({"bias": None}, "its tensor 'bias' is missing"),
    ],
)
def test_weights_must_be_those_of_the_network(change, reason):
    layer = nn.Linear(3, 2)
    before = {name: value.clone() for name, value in layer.state_dict().items()}
    tensors = {name: value for name, value in {**before, **change}.items() if value is not None}
    with pytest.raises(ValueError, match=reason):
        load_weights(layer, tensors)
    assert all(torch.equal(layer.state_dict()[name], value) for name, value in before.items())
    load_weights(layer, {name: value + 1 for name, value in before.items()})
    assert torch.equal(layer.bias, before["bias"] + 1)


def test_values_of_a_header_are_of_their_kind():
    assert (finite_number("a", 2), whole_number("a", 3, 1, 3), plain_text("a", "b")) == (2.0, 3, "b")
    for value in ("1", True, float("nan"), float("inf"), None, [1], 1e31):
        with pytest.raises(ValueError, match="the scale is"):
            finite_number("the scale", value, 1e-30, 1e30)
    for value in ("1", True, 1.0, 0, 4, None):
        with pytest.raises(ValueError, match="layers is"):
            whole_number("layers", value, 1, 3)
    for value in (1, None, "x" * 11):
        with pytest.raises(ValueError, match="the name is no text"):
            plain_text("the name", value, 10)
