"""Native code runs only where its result would be the same as torch's, gradients included."""

import pytest
import torch

from surfsup import native
from surfsup.native.dispatch import can_run_native, fastest_isa, is_built, needs_gradient, tensors_requiring_grad
from surfsup.sdf import Box, Sphere, Union


@pytest.fixture
def built(monkeypatch):
    monkeypatch.setattr(native, "instruction_sets", lambda: ["avx2", "plain"])


@pytest.fixture
def not_built(monkeypatch):
    monkeypatch.setattr(native, "instruction_sets", list)


def test_single_precision_on_the_cpu_runs_native(built):
    assert can_run_native(torch.zeros(5, 3), torch.zeros(3))


def test_nothing_runs_native_without_the_native_code(not_built):
    assert not is_built()
    assert not can_run_native()
    assert not can_run_native(torch.zeros(5, 3))


def test_without_tensors_the_answer_is_whether_the_native_code_is_built(built):
    assert is_built()
    assert can_run_native()


@pytest.mark.parametrize("other", [torch.zeros(3, dtype=torch.float64), torch.zeros(3, device="meta")])
def test_one_tensor_of_another_precision_or_device_keeps_all_in_torch(built, other):
    assert not can_run_native(torch.zeros(5, 3), other)


def test_a_native_function_in_double_precision_takes_only_such_tensors(built):
    assert can_run_native(torch.zeros(3, dtype=torch.float64), dtype=torch.float64)
    assert not can_run_native(torch.zeros(3), dtype=torch.float64)


def test_a_tensor_that_requires_a_gradient_keeps_all_in_torch(built):
    points = torch.zeros(5, 3, requires_grad=True)
    assert not can_run_native(torch.zeros(3), points)
    assert can_run_native(torch.zeros(3), points.detach())
    with torch.no_grad():
        assert can_run_native(torch.zeros(3), points)


def test_a_shape_that_requires_a_gradient_keeps_all_in_torch(built):
    sphere = Sphere(torch.tensor(0.3, requires_grad=True))
    assert not can_run_native(torch.zeros(5, 3), module=sphere)
    assert can_run_native(torch.zeros(5, 3), module=Sphere(0.3))
    with torch.no_grad():
        assert can_run_native(torch.zeros(5, 3), module=sphere)


def test_the_precision_of_a_shape_does_not_matter(built):
    assert can_run_native(torch.zeros(5, 3), module=Sphere(torch.tensor(0.3, dtype=torch.float64)))


def test_a_gradient_is_needed_only_where_torch_records_it():
    points = torch.zeros(5, 3, requires_grad=True)
    assert needs_gradient(points)
    assert not needs_gradient(points.detach())
    with torch.no_grad():
        assert not needs_gradient(points)


def test_parameters_and_buffers_that_require_a_gradient_are_listed_once():
    radius = torch.tensor(0.3, requires_grad=True)
    sphere = Sphere(radius)
    layer = torch.nn.Linear(2, 1)
    assert tensors_requiring_grad(Union(sphere, sphere, Box((1.0, 1.0, 1.0)))) == [radius]
    assert tensors_requiring_grad(layer) == [layer.weight, layer.bias]
    assert tensors_requiring_grad(Sphere(0.3)) == []
    assert tensors_requiring_grad(None) == []


def test_the_fastest_instruction_set_comes_first(built):
    assert fastest_isa() == "avx2"
