"""SIREN: value and gradient of the network, grid far from the surface, files."""

import json

import pytest
import torch
from safetensors.torch import load_file, save_file

from surfsup.errors import InputError
from surfsup.native.dispatch import tensors_requiring_grad
from surfsup.sdf import SirenSurface, load_siren, save_siren
from surfsup.sdf.neural import surface_file
from surfsup.sdf.neural.sine_network import SineNetwork
from surfsup.sdf.neural.siren import Normalization
from tests.sdf.solids import sphere_grid

BOX = torch.tensor([[-1.0, -1, -1], [1, 1, 1]])


def network(width=16, layers=2) -> SineNetwork:
    torch.manual_seed(0)
    return SineNetwork(width, layers, 10.0)


def random_points(count=50) -> torch.Tensor:
    return 2 * torch.rand(count, 3, generator=torch.Generator().manual_seed(1)) - 1


def test_the_gradient_in_one_pass_is_that_of_autograd():
    field, points = network(), random_points().requires_grad_()
    value, gradient = field.value_and_gradient(points)
    torch.testing.assert_close(value, field.value(points))
    (expected,) = torch.autograd.grad(field.value(points).sum(), points)
    torch.testing.assert_close(gradient, expected, rtol=1e-4, atol=1e-5)


def test_value_and_normal_are_differentiable_in_points_and_weights():
    field = network().double()
    field.last_bias.data -= 0.01
    points = random_points(5).double().requires_grad_()
    assert torch.autograd.gradcheck(lambda x: field.value_and_gradient(x), points)
    _, gradient = field.value_and_gradient(points)
    gradient.square().sum().backward()
    assert all(weight.grad is not None and weight.grad.abs().sum() > 0 for weight in field.weights)


def test_weights_are_initialized_as_published():
    """The arguments of all sines but the first have a standard deviation near one (Sitzmann et al., section 1.5)."""
    torch.manual_seed(0)
    field, hidden = SineNetwork(256, 3, 30.0), 2 * torch.rand(2000, 3) - 1
    for number, (weight, bias) in enumerate(zip(field.weights, field.biases, strict=True)):
        argument = 30 * (hidden @ weight.T + bias)
        if number:
            assert 0.5 < float(argument.detach().std()) < 3
        hidden = torch.sin(argument)
    assert float(field.weights[0].detach().abs().max()) <= 1 / 3


def test_distances_come_from_the_network_near_the_surface_and_from_the_grid_elsewhere():
    field = network()
    surface = SirenSurface(field, BOX, sphere_grid()).requires_grad_(False)
    near, far = torch.tensor([[0.8, 0, 0], [0, 0.75, 0]]), torch.tensor([[1.1, 0, 0], [0, 0, 0.5]])
    distance, normal = surface.distance_and_normal(torch.cat([near, far]))
    with torch.no_grad():
        value, gradient = field.value_and_gradient(near)
    torch.testing.assert_close(distance[:2], value)
    torch.testing.assert_close(normal[:2], torch.nn.functional.normalize(gradient, dim=-1))
    torch.testing.assert_close(distance[2:], torch.tensor([0.3, -0.3]), atol=2e-3, rtol=0)
    torch.testing.assert_close(surface.distance(torch.cat([near, far])), distance)
    empty = surface.distance_and_normal(torch.zeros(0, 3))
    assert (empty[0].shape, empty[1].shape) == ((0,), (0, 3))


def test_distances_are_differentiable_in_the_points_near_far_and_beyond_the_grid():
    surface = SirenSurface(network(), BOX, sphere_grid()).requires_grad_(False)
    points = torch.tensor([[0.8, 0.1, 0], [1.1, 0.1, 0], [3.0, 0, 0]], requires_grad=True)
    distance, normal = surface.distance_and_normal(points)
    (gradient,) = torch.autograd.grad(distance.sum(), points)
    torch.testing.assert_close(torch.nn.functional.normalize(gradient, dim=-1), normal.detach(), atol=0.05, rtol=0)


def test_a_saved_surface_loads_as_it_was(tmp_path):
    path, points = tmp_path / "surface.safetensors", random_points()
    surface = SirenSurface(network(), BOX, sphere_grid(), Normalization((1.0, 2.0, 3.0), 0.5), {"input": "a ball"})
    save_siren(path, surface)
    back = load_siren(path)
    assert (back.normalization, back.about) == (surface.normalization, {"input": "a ball"})
    assert not tensors_requiring_grad(back)
    torch.testing.assert_close(back.distance(points), surface.distance(points).detach(), atol=1e-3, rtol=0)
    assert b"pickle" not in path.read_bytes()
    original = back.in_original_units()
    torch.testing.assert_close(original.distance(points / 0.5 + torch.tensor([1.0, 2, 3])), back.distance(points) / 0.5)


def test_files_of_version_0_1_load(tmp_path):
    path = tmp_path / "surface.safetensors"
    save_siren(path, SirenSurface(network(), BOX, sphere_grid(), Normalization((1.0, 2.0, 3.0), 0.5)))
    header, tensors = surface_file.read(path, surface_file.SIREN)
    header["cube"] = {"centre": header["cube"]["center"], "scale": header["cube"]["scale"]}
    surface_file.write(path, surface_file.SIREN, header, tensors)
    assert load_siren(path).normalization == Normalization((1.0, 2.0, 3.0), 0.5)


def test_saving_a_loaded_surface_changes_nothing(tmp_path):
    first, second = tmp_path / "first.safetensors", tmp_path / "second.safetensors"
    save_siren(first, SirenSurface(network(), BOX, sphere_grid()))
    save_siren(second, load_siren(first))
    (header, tensors), (header_again, tensors_again) = (
        surface_file.read(path, surface_file.SIREN) for path in (first, second)
    )
    assert header == header_again
    assert all(torch.equal(tensors[name], tensors_again[name]) for name in tensors)


def rewrite(path, change):
    tensors = load_file(path)
    header = {"sizes": {"width": 16, "layers": 2, "frequency": 10.0}, "cube": {"center": [0, 0, 0], "scale": 1}}
    header["about"] = {}
    metadata = {"format": surface_file.SIREN, "surface": None}
    change(tensors, header, metadata)
    metadata["surface"] = metadata["surface"] or json.dumps(header)
    save_file(tensors, path, metadata)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda tensors, header, metadata: tensors.pop("network.last"), "do not fit its architecture"),
        (lambda tensors, header, metadata: header["sizes"].update(width=32), "do not fit its architecture"),
        (lambda tensors, header, metadata: header["sizes"].update(layers=10**9), "do not fit its architecture"),
        (lambda tensors, header, metadata: header["sizes"].update(depth=3), "do not fit its architecture"),
        (lambda tensors, header, metadata: header.update(cell=0.02), "do not fit its architecture"),
        (lambda tensors, header, metadata: tensors.update({"lattice.lower": BOX[0]}), "do not fit its architecture"),
        (lambda tensors, header, metadata: tensors["network.last"].fill_(float("nan")), "not finite"),
        (lambda tensors, header, metadata: metadata.update(surface="{"), "damaged"),
        (lambda tensors, header, metadata: metadata.update(surface="[]"), "damaged"),
        (
            lambda tensors, header, metadata: metadata.update(format="surfsup-simulator-2"),
            "holds 'surfsup-simulator-2'",
        ),
    ],
)
def test_files_of_something_else_are_refused(tmp_path, change, message):
    path = tmp_path / "surface.safetensors"
    save_siren(path, SirenSurface(network(), BOX))
    rewrite(path, change)
    with pytest.raises(InputError, match=message):
        load_siren(path)


def test_missing_and_truncated_files_are_refused(tmp_path):
    path = tmp_path / "surface.safetensors"
    with pytest.raises(InputError, match="no such file"):
        load_siren(path)
    save_siren(path, SirenSurface(network(), BOX))
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(InputError, match="cut off or not a safetensors file"):
        load_siren(path)
    assert surface_file.COMMANDS[surface_file.SIREN] == "surfsup fit siren"


def test_a_network_without_channels_is_refused():
    with pytest.raises(InputError, match="must be positive"):
        SineNetwork(0, 1)
    assert not SirenSurface(network(), BOX).exact_outside
