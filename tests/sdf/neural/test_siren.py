import json

import pytest
import torch
from safetensors.torch import load_file, save_file

from surfsup.errors import InputError
from surfsup.native.dispatch import tensors_requiring_grad
from surfsup.sdf import SirenSurface, load_siren, save_siren
from surfsup.sdf.grid import Lattice
from surfsup.sdf.neural import surface_file
from surfsup.sdf.neural.sine_network import SineNetwork
from surfsup.sdf.neural.siren import Cube

BOX = torch.tensor([[-1.0, -1, -1], [1, 1, 1]])


def network(width=16, layers=2) -> SineNetwork:
    torch.manual_seed(0)
    return SineNetwork(width, layers, 10.0)


def points(count=50) -> torch.Tensor:
    return 2 * torch.rand(count, 3, generator=torch.Generator().manual_seed(1)) - 1


def lattice_of_a_sphere(cell=0.1) -> Lattice:
    lower = torch.full((3,), -1.2)
    axis = torch.arange(25) * cell - 1.2
    nodes = torch.stack(torch.meshgrid(axis, axis, axis, indexing="ij"), dim=-1)
    return Lattice(torch.linalg.vector_norm(nodes, dim=-1) - 0.8, lower, cell)


def test_the_gradient_in_one_pass_is_that_of_autograd():
    field, places = network(), points().requires_grad_()
    value, gradient = field.value_and_gradient(places)
    torch.testing.assert_close(value, field.value(places))
    (expected,) = torch.autograd.grad(field.value(places).sum(), places)
    torch.testing.assert_close(gradient, expected, rtol=1e-4, atol=1e-5)


def test_value_and_normal_are_differentiable_in_points_and_weights():
    field = network().double()
    field.last_bias.data -= 0.01
    places = points(5).double().requires_grad_()
    assert torch.autograd.gradcheck(lambda x: field.value_and_gradient(x), places)
    _, gradient = field.value_and_gradient(places)
    gradient.square().sum().backward()
    assert all(weight.grad is not None and weight.grad.abs().sum() > 0 for weight in field.weights)


def test_the_weights_start_as_published():
    """Arguments of all sines but the first's are spread alike, with a deviation near one (Sitzmann et al., 1.5)."""
    torch.manual_seed(0)
    field, hidden = SineNetwork(256, 3, 30.0), 2 * torch.rand(2000, 3) - 1
    for number, (weight, bias) in enumerate(zip(field.weights, field.biases, strict=True)):
        argument = 30 * (hidden @ weight.T + bias)
        if number:
            assert 0.5 < float(argument.detach().std()) < 3
        hidden = torch.sin(argument)
    assert float(field.weights[0].detach().abs().max()) <= 1 / 3


def test_a_lattice_has_the_distance_between_its_nodes_and_beyond_them():
    lattice = lattice_of_a_sphere()
    places = 1.1 * points(400)
    places = places[torch.linalg.vector_norm(places, dim=-1) > 0.3]
    distance, gradient = lattice.sample(places)
    radius = torch.linalg.vector_norm(places, dim=-1)
    torch.testing.assert_close(distance, radius - 0.8, atol=4e-3, rtol=0)
    cosine = torch.nn.functional.cosine_similarity(gradient, places)
    assert float(cosine.min()) > 0.99
    far = torch.tensor([[3.0, 0, 0], [0, -5, 0.1], [2.0, 2.0, 2.0]])
    distance, gradient = lattice.sample(far)
    torch.testing.assert_close(distance, torch.linalg.vector_norm(far, dim=-1) - 0.8, atol=0.02, rtol=0)
    torch.testing.assert_close(lattice.values()[3, 4, 5], lattice_of_a_sphere().values()[3, 4, 5])


def test_the_network_is_asked_near_the_surface_and_the_lattice_far_from_it():
    field = network()
    surface = SirenSurface(field, BOX, lattice_of_a_sphere()).requires_grad_(False)
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


def test_distances_are_differentiable_in_the_points_on_both_sides_of_the_border():
    surface = SirenSurface(network(), BOX, lattice_of_a_sphere()).requires_grad_(False)
    places = torch.tensor([[0.8, 0.1, 0], [1.1, 0.1, 0], [3.0, 0, 0]], requires_grad=True)
    distance, normal = surface.distance_and_normal(places)
    (gradient,) = torch.autograd.grad(distance.sum(), places)
    torch.testing.assert_close(torch.nn.functional.normalize(gradient, dim=-1), normal.detach(), atol=0.05, rtol=0)


def test_a_surface_comes_back_from_its_file_as_it_was(tmp_path):
    path, places = tmp_path / "surface.safetensors", points()
    surface = SirenSurface(network(), BOX, lattice_of_a_sphere(), Cube((1.0, 2.0, 3.0), 0.5), {"input": "a ball"})
    save_siren(path, surface)
    back = load_siren(path)
    assert (back.cube, back.about) == (surface.cube, {"input": "a ball"})
    assert not tensors_requiring_grad(back)
    torch.testing.assert_close(back.distance(places), surface.distance(places).detach(), atol=1e-3, rtol=0)
    assert b"pickle" not in path.read_bytes()
    placed = back.in_own_unit()
    torch.testing.assert_close(placed.distance(places / 0.5 + torch.tensor([1.0, 2, 3])), back.distance(places) / 0.5)


def broken(path, change):
    tensors = load_file(path)
    header = {"sizes": {"width": 16, "layers": 2, "frequency": 10.0}, "cube": {"center": [0, 0, 0], "scale": 1}}
    header["about"] = {}
    metadata = {"format": surface_file.SIREN, "surface": None}
    change(tensors, header, metadata)
    metadata["surface"] = metadata["surface"] or json.dumps(header)
    save_file(tensors, path, metadata)


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda tensors, header, metadata: tensors.pop("network.last"), "do not fit its architecture"),
        (lambda tensors, header, metadata: header["sizes"].update(width=32), "do not fit its architecture"),
        (lambda tensors, header, metadata: header["sizes"].update(layers=10**9), "do not fit its architecture"),
        (lambda tensors, header, metadata: header["sizes"].update(depth=3), "do not fit its architecture"),
        (lambda tensors, header, metadata: tensors["network.last"].fill_(float("nan")), "not finite"),
        (lambda tensors, header, metadata: metadata.update(surface="{"), "damaged"),
        (lambda tensors, header, metadata: metadata.update(surface="[]"), "damaged"),
        (
            lambda tensors, header, metadata: metadata.update(format="surfsup-simulator-2"),
            "holds 'surfsup-simulator-2'",
        ),
    ],
)
def test_a_file_of_something_else_is_refused(tmp_path, change, complaint):
    path = tmp_path / "surface.safetensors"
    save_siren(path, SirenSurface(network(), BOX))
    broken(path, change)
    with pytest.raises(InputError, match=complaint):
        load_siren(path)


def test_a_file_that_is_missing_or_cut_off_is_told_of(tmp_path):
    path = tmp_path / "surface.safetensors"
    with pytest.raises(InputError, match="no such file"):
        load_siren(path)
    save_siren(path, SirenSurface(network(), BOX))
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(InputError, match="cut off or not a safetensors file"):
        load_siren(path)
    assert surface_file.VERBS[surface_file.SIREN] == "surfsup fit siren"


def test_a_network_of_no_size_is_refused():
    with pytest.raises(InputError, match="is none"):
        SineNetwork(0, 1)
    assert not SirenSurface(network(), BOX).exact_outside
