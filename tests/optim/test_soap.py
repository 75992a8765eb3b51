import copy

import pytest
import torch

from surfsup.optim.soap import Soap, eigenvectors


def curvature_matrix(size: int, seed: int = 0) -> torch.Tensor:
    """Curvatures from 1 to 1e4, along directions that mix all weights."""
    torch.manual_seed(seed)
    rotation = torch.linalg.qr(torch.randn(size, size)).Q
    return rotation @ torch.diag(torch.logspace(0, 4, size)) @ rotation.T


def descend(optimizer: torch.optim.Optimizer, weight: torch.Tensor, curvature: torch.Tensor, steps: int) -> float:
    for _ in range(steps):
        loss = (weight.T @ curvature @ weight).diagonal().sum() / 2
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return float(loss.detach())


def test_a_vector_is_updated_as_by_adam():
    torch.manual_seed(0)
    ours, theirs = torch.zeros(5, requires_grad=True), torch.zeros(5, requires_grad=True)
    soap, adam = Soap([ours], lr=0.01), torch.optim.Adam([theirs], lr=0.01, betas=(0.95, 0.98))
    ours.grad = torch.randn(5)
    soap.step()  # the first gradient only initializes the bases
    for _ in range(20):
        ours.grad = torch.randn(5)
        theirs.grad = ours.grad.clone()
        soap.step()
        adam.step()
    torch.testing.assert_close(ours, theirs)
    assert ours.abs().min() > 0


def test_a_rotated_valley_takes_far_fewer_steps_than_with_adam():
    curvature, start = curvature_matrix(8), torch.ones(8, 4)
    losses = {}
    for optimizer in (Soap, torch.optim.Adam):
        weight = start.clone().requires_grad_()
        losses[optimizer] = descend(optimizer([weight], lr=0.03), weight, curvature, 300)
    assert losses[Soap] < 0.05 * losses[torch.optim.Adam]


def test_the_bases_stay_orthogonal_and_approach_the_eigenvectors():
    torch.manual_seed(0)
    weight = torch.zeros(6, 3, requires_grad=True)
    soap, spread = Soap([weight], lr=1e-3), torch.diag(torch.logspace(0, 2, 6))
    rotation = torch.linalg.qr(torch.randn(6, 6)).Q
    for _ in range(2000):
        weight.grad = rotation @ spread @ torch.randn(6, 3)
        soap.step()
    basis, products = soap.state[weight]["rows_basis"], soap.state[weight]["rows"]
    torch.testing.assert_close(basis.T @ basis, torch.eye(6), atol=1e-5, rtol=0)
    rotated = basis.T @ products @ basis
    assert (rotated - torch.diag(rotated.diagonal())).norm() < 0.1 * products.norm()
    assert (products - torch.diag(products.diagonal())).norm() > 0.3 * products.norm()


def test_a_parameter_without_gradient_stays():
    still, moving = torch.ones(3, 2, requires_grad=True), torch.ones(3, 2, requires_grad=True)
    soap = Soap([still, moving], lr=0.1)
    moving.grad = torch.ones(3, 2)
    soap.step()
    soap.step()
    assert torch.equal(still, torch.ones(3, 2)) and not soap.state[still]
    assert not torch.equal(moving, torch.ones(3, 2))


def test_zero_gradients_change_nothing():
    weight = torch.ones(3, 2, requires_grad=True)
    soap = Soap([weight], lr=0.1)
    weight.grad = torch.zeros(3, 2)
    for _ in range(12):
        soap.step()
    assert torch.equal(weight, torch.ones(3, 2))


@pytest.mark.parametrize("steps", [1, 9, 10, 25])
def test_its_state_is_tensors_from_which_another_continues_bit_for_bit(steps):
    curvature = curvature_matrix(5)
    weight = torch.ones(5, 2, requires_grad=True)
    soap = Soap([weight], lr=0.01)
    descend(soap, weight, curvature, steps)
    saved = copy.deepcopy(soap.state_dict())
    assert all(isinstance(value, torch.Tensor) for value in saved["state"][0].values())
    other = weight.detach().clone().requires_grad_()
    again = Soap([other], lr=0.01)
    again.load_state_dict({"state": saved["state"], "param_groups": again.state_dict()["param_groups"]})
    descend(soap, weight, curvature, 15)
    descend(again, other, curvature, 15)
    assert torch.equal(weight, other)


def assert_diagonalizes(basis: torch.Tensor, product: torch.Tensor) -> None:
    size = len(product)
    torch.testing.assert_close(basis.T @ basis, torch.eye(size), atol=1e-4, rtol=0)
    rotated = basis.T @ product @ basis
    assert (rotated - torch.diag(rotated.diagonal())).norm() < 1e-4 * product.norm()


def test_the_eigenvectors_of_a_product_of_low_rank():
    gradient = torch.randn(64, 3, generator=torch.Generator().manual_seed(0))
    assert_diagonalizes(eigenvectors(gradient @ gradient.T), gradient @ gradient.T)


def test_eigenvectors_that_are_nan_in_single_precision_are_computed_in_double(monkeypatch):
    eigh, used = torch.linalg.eigh, []

    def failing_in_single(matrix):  # which matrices fail depends on the LAPACK of the machine
        used.append(matrix.dtype)
        result = eigh(matrix)
        if matrix.dtype == torch.float32:
            result.eigenvectors[0, 0] = torch.nan
        return result

    monkeypatch.setattr(torch.linalg, "eigh", failing_in_single)
    curvature = curvature_matrix(8)
    basis = eigenvectors(curvature)
    assert used == [torch.float32, torch.float64]
    assert basis.dtype == torch.float32 and basis.is_contiguous()
    assert_diagonalizes(basis, curvature)
