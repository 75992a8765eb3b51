"""DeepSDF: value and gradient of the decoder, shapes by name or code, files."""

import pytest
import torch

from surfsup.errors import InputError
from surfsup.sdf import DeepSdf, load_deepsdf, load_siren, save_deepsdf
from surfsup.sdf.neural import surface_file
from surfsup.sdf.neural.deepsdf_decoder import DecoderSizes, DeepSdfDecoder


def shapes(count=3) -> DeepSdf:
    torch.manual_seed(0)
    network = DeepSdfDecoder(DecoderSizes(width=16, layers=4, code=5, octaves=2))
    names = ["stool", "chair", "bench"][:count]
    return DeepSdf(network, torch.randn(count, 5), names, {"input": "wood"}, "wood.safetensors")


def random_points(count=40) -> torch.Tensor:
    return 2 * torch.rand(count, 3, generator=torch.Generator().manual_seed(1)) - 1


def test_the_gradient_in_one_pass_is_that_of_autograd():
    family, points = shapes(), random_points().requires_grad_()
    code = family.codes[1]
    value, gradient = family.network.value_and_gradient(points, code)
    alone = family.network.value(points[None], code[None])[0]
    torch.testing.assert_close(value, alone)
    (expected,) = torch.autograd.grad(alone.sum(), points)
    torch.testing.assert_close(gradient, expected, rtol=1e-4, atol=1e-5)


def test_a_batch_of_shapes_gives_the_distances_of_each():
    family, points = shapes(), random_points(60).reshape(3, 20, 3)
    together = family.network.value(points, family.codes)
    for number in range(3):
        alone = family.surface(family.codes[number]).distance(points[number])
        torch.testing.assert_close(together[number], alone)


def test_a_surface_is_differentiable_in_points_and_code():
    family = shapes().requires_grad_(False).double()
    code = family.codes[0].clone().requires_grad_()
    points = random_points(6).double().requires_grad_()
    assert torch.autograd.gradcheck(lambda x, z: family.network.value(x[None], z[None])[0], (points, code))
    code = torch.randn(5, requires_grad=True)
    surface = shapes().requires_grad_(False).surface(code)
    distance, normal = surface.distance_and_normal(random_points())
    torch.testing.assert_close(torch.linalg.vector_norm(normal, dim=-1), torch.ones(len(normal)))
    distance.square().sum().backward()
    assert code.grad is not None
    assert float(code.grad.abs().sum()) > 0


def test_saved_shapes_load_as_they_were(tmp_path):
    path, family = tmp_path / "wood.safetensors", shapes()
    save_deepsdf(path, family)
    back = load_deepsdf(path)
    assert (back.names, back.about) == (family.names, family.about)
    torch.testing.assert_close(
        back.surface(back.code("chair")).distance(random_points()),
        family.surface(family.code("chair")).distance(random_points()),
    )
    assert surface_file.read_format(path) == surface_file.DEEPSDF
    with pytest.raises(InputError, match="make one with 'surfsup fit siren'"):
        load_siren(path)


def test_files_of_version_0_1_load(tmp_path):
    path, family = tmp_path / "wood.safetensors", shapes()
    save_deepsdf(path, family)
    header, tensors = surface_file.read(path, surface_file.DEEPSDF)
    old_names = {"from_position": "of_place", "from_code": "of_code"}
    for new, old in old_names.items():
        tensors = {name.replace(new, old): value for name, value in tensors.items()}
    surface_file.write(path, surface_file.DEEPSDF, header, tensors)
    back = load_deepsdf(path)
    for name, value in family.network.state_dict().items():
        assert torch.equal(back.network.state_dict()[name], value)


def test_only_a_single_shape_needs_no_name():
    assert shapes(1).code().shape == (5,)
    with pytest.raises(InputError, match="holds 3 shapes; choose one by its name, as in --shape stool"):
        shapes().code()
    with pytest.raises(InputError, match="has no shape 'chiar'; did you mean 'chair'"):
        shapes().code("chiar")


@pytest.mark.parametrize(
    ("code", "message"),
    [
        (torch.zeros(4), r"a code has 5 numbers, but \(4,\) were given"),
        (torch.zeros(1, 5), r"but \(1, 5\)"),
        (torch.full((5,), float("nan")), "not finite"),
    ],
)
def test_invalid_codes_are_refused(code, message):
    with pytest.raises(InputError, match=message):
        shapes().surface(code)


@pytest.mark.parametrize("sizes", [{"width": 32}, {"code": 6}, {"layers": 9}, {"octaves": 3}, {"octaves": 10**6}])
def test_weights_of_another_architecture_are_refused(tmp_path, sizes):
    path, family = tmp_path / "wood.safetensors", shapes()
    family.network.sizes = DecoderSizes(**{"width": 16, "layers": 4, "code": 5, "octaves": 2, **sizes})
    save_deepsdf(path, family)
    with pytest.raises(InputError, match="do not fit its architecture"):
        load_deepsdf(path)
