import numpy as np
import pytest
import trimesh

from surfsup.errors import InputError
from surfsup.fitting.fit import fit_folder
from surfsup.fitting.siren_input import load_target


def test_a_mesh_is_turned_upright_and_has_exact_distances(tmp_path):
    path = tmp_path / "brick.obj"
    trimesh.creation.box((4.0, 2.0, 1.0)).export(path)
    target, exact = load_target(path, "y", 1000, 0)
    assert target.normalization.scale == 0.5
    assert target.around is not None
    samples = exact.samples_at(np.array([[0.0, 0.0, 1.2], [0.0, 0.4, 0.0]]))
    np.testing.assert_allclose(samples.distance, [0.7, 0.15], atol=1e-6)


def test_the_surface_of_a_scene_keeps_its_position(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(
        "surface: {sphere: {radius: 0.2}, at: [0.1, 0, 0.3]}\n"
        "fluid: [{block: {min: [-0.2, -0.2, 1.0], max: [0.2, 0.2, 1.2]}}]\n"
    )
    target, _ = load_target(path, None, 1000, 0)
    np.testing.assert_allclose(target.normalization.center, (0.1, 0, 0.3), atol=5e-3)


def test_a_cloud_is_turned_upright(tmp_path):
    directions = np.random.default_rng(0).normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    normals = directions / [1, 3, 1]  # of an ellipsoid
    rows = np.concatenate([directions * [1, 3, 1], normals / np.linalg.norm(normals, axis=1, keepdims=True)], axis=1)
    path = tmp_path / "cloud.xyz"
    path.write_text("\n".join(" ".join(map(str, row)) for row in rows))
    target, exact = load_target(path, "y", 1000, 0)
    assert exact is None
    spread = target.surface.points.std(dim=0)
    assert spread.argmax() == 2


@pytest.mark.parametrize(
    ("name", "up", "complaint"),
    [
        ("none.obj", None, "none.obj: cannot be read"),
        ("text.txt", None, "a SIREN cannot be fitted to this; give a file that ends in one of .obj"),
        ("ball.obj", "x", "--up is 'x', but must be y or z"),
    ],
)
def test_an_unusable_input_is_named(tmp_path, name, up, complaint):
    with pytest.raises(InputError, match=complaint):
        load_target(tmp_path / name, up, 1000, 0)


def test_an_empty_scene_is_refused(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text("fluid: [{block: {min: [-0.2, -0.2, 1.0], max: [0.2, 0.2, 1.2]}}]\n")
    with pytest.raises(InputError, match="its container is empty"):
        load_target(path, None, 1000, 0)


def test_the_output_is_a_safetensors_file(tmp_path):
    assert fit_folder(tmp_path / "a.safetensors", resume=False) == tmp_path / "a.fit"
    with pytest.raises(InputError, match=r"give -o a\.safetensors"):
        fit_folder(tmp_path / "a.obj", resume=False)
