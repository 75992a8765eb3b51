import pytest
import torch

from surfsup.errors import InputError
from surfsup.sdf import DeepSdf, load_deepsdf, load_siren, save_deepsdf
from surfsup.sdf.neural import surface_file
from surfsup.sdf.neural.code_network import CodeNetwork, CodeSizes


def shapes(count=3) -> DeepSdf:
    torch.manual_seed(0)
    network = CodeNetwork(CodeSizes(width=16, layers=4, code=5, octaves=2))
    names = ["stool", "chair", "bench"][:count]
    return DeepSdf(network, torch.randn(count, 5), names, {"input": "wood"}, "wood.safetensors")


def points(count=40) -> torch.Tensor:
    return 2 * torch.rand(count, 3, generator=torch.Generator().manual_seed(1)) - 1


def test_the_gradient_in_one_pass_is_that_of_autograd():
    known, places = shapes(), points().requires_grad_()
    code = known.codes[1]
    value, gradient = known.network.value_and_gradient(places, code)
    alone = known.network.value(places[None], code[None])[0]
    torch.testing.assert_close(value, alone)
    (expected,) = torch.autograd.grad(alone.sum(), places)
    torch.testing.assert_close(gradient, expected, rtol=1e-4, atol=1e-5)


def test_many_shapes_at_once_are_each_by_itself():
    known, places = shapes(), points(60).reshape(3, 20, 3)
    together = known.network.value(places, known.codes)
    for number in range(3):
        alone = known.surface(known.codes[number]).distance(places[number])
        torch.testing.assert_close(together[number], alone)


def test_a_surface_is_differentiable_in_points_and_code():
    known = shapes().requires_grad_(False).double()
    code = known.codes[0].clone().requires_grad_()
    places = points(6).double().requires_grad_()
    assert torch.autograd.gradcheck(lambda x, z: known.network.value(x[None], z[None])[0], (places, code))
    code = torch.randn(5, requires_grad=True)
    surface = shapes().requires_grad_(False).surface(code)
    distance, normal = surface.distance_and_normal(points())
    torch.testing.assert_close(torch.linalg.vector_norm(normal, dim=-1), torch.ones(len(normal)))
    distance.square().sum().backward()
    assert code.grad is not None
    assert float(code.grad.abs().sum()) > 0


def test_shapes_come_back_from_their_file_as_they_were(tmp_path):
    path, known = tmp_path / "wood.safetensors", shapes()
    save_deepsdf(path, known)
    back = load_deepsdf(path)
    assert (back.names, back.about) == (known.names, known.about)
    torch.testing.assert_close(
        back.surface(back.code("chair")).distance(points()), known.surface(known.code("chair")).distance(points())
    )
    assert surface_file.kind_of(path) == surface_file.DEEPSDF
    with pytest.raises(InputError, match="make one with 'surfsup fit siren'"):
        load_siren(path)


def test_the_only_shape_needs_no_name_and_others_do():
    assert shapes(1).code().shape == (5,)
    with pytest.raises(InputError, match="holds 3 shapes; choose one by its name, as 'stool'"):
        shapes().code()
    with pytest.raises(InputError, match="has no shape 'chiar'; did you mean 'chair'"):
        shapes().code("chiar")


@pytest.mark.parametrize(
    ("code", "complaint"),
    [
        (torch.zeros(4), r"a code of it is 5 numbers, but \(4,\) were given"),
        (torch.zeros(1, 5), r"but \(1, 5\)"),
        (torch.full((5,), float("nan")), "not finite"),
    ],
)
def test_a_code_that_is_none_is_refused(code, complaint):
    with pytest.raises(InputError, match=complaint):
        shapes().surface(code)


@pytest.mark.parametrize("sizes", [{"width": 32}, {"code": 6}, {"layers": 9}, {"octaves": 3}, {"octaves": 10**6}])
def test_weights_of_another_architecture_are_refused(tmp_path, sizes):
    path, known = tmp_path / "wood.safetensors", shapes()
    known.network.sizes = CodeSizes(**{"width": 16, "layers": 4, "code": 5, "octaves": 2, **sizes})
    save_deepsdf(path, known)
    with pytest.raises(InputError, match="do not fit its architecture"):
        load_deepsdf(path)
