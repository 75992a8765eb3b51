"""The shipped neural surfaces: valid shapes, found by name."""

from pathlib import Path

import pytest
import torch

from surfsup.errors import InputError
from surfsup.scene import Container, Scene
from surfsup.scene.from_surface import Placement, scene_from_surface
from surfsup.sdf import load_deepsdf, load_siren, shipped_surfaces, surface_path
from surfsup.sdf.neural.shipped_surfaces import path_from

FAMILIES = {"chairs": 500, "bowls": 200}
MAX_BYTES = 10_000_000  # of all of them


def test_a_coral_and_two_families_ship_small_and_with_cards():
    files = shipped_surfaces()
    assert set(files) == {"bowls", "chairs", "coral"}
    assert sum(path.stat().st_size for path in files.values()) < MAX_BYTES
    for name, path in files.items():
        assert path.with_suffix(".md").read_text().startswith(f"# {name}\n")


def test_the_coral_is_in_one_piece_and_fits_its_bounds():
    coral = load_siren(Path("coral"))
    lower, upper = coral.bounds()
    assert float((upper - lower).max()) == pytest.approx(2.0, abs=0.02)
    beside = upper[None] + 0.2
    assert float(coral.distance(beside)) > 0.1
    assert 0.9 < float(torch.linalg.vector_norm(coral.distance_and_normal(beside)[1])) < 1.1
    assert coral.about["errors"]["parts"] == 1


@pytest.mark.parametrize("family", FAMILIES)
def test_a_family_has_its_shapes_by_name(family):
    shapes = load_deepsdf(Path(family))
    assert len(shapes.names) == FAMILIES[family]
    surface = shapes.surface(shapes.code(shapes.names[0]))
    axis = torch.linspace(-1, 1, 24)
    distance = surface.distance(torch.cartesian_prod(axis, axis, axis))
    assert float(distance.min()) < 0 < float(distance.max())


def test_paths_without_a_suffix_are_names_of_shipped_surfaces():
    assert surface_path(Path("coral")) == shipped_surfaces()["coral"]
    assert surface_path(Path("own/coral")) == Path("own/coral")
    assert surface_path(Path("coral.safetensors")) == Path("coral.safetensors")
    assert path_from(Path("scenes"), Path("coral")) == Path("coral")
    assert path_from(Path("scenes"), Path("mine.safetensors")) == Path("scenes/mine.safetensors")


def test_a_scene_refers_to_a_shipped_surface_by_its_name(tmp_path):
    water = "fluid: [{block: {min: [-0.1, -0.1, 0.8], max: [0.1, 0.1, 1.0]}}]"
    (tmp_path / "scene.yaml").write_text(f"surface: {{siren: {{file: coral, fit: 0.7}}}}\n{water}\n")
    scene = Scene.load(tmp_path / "scene.yaml")
    assert float(scene.build_surface().bounds()[0, 2]) == pytest.approx(0.0, abs=1e-6)
    assert "file: coral" in scene.with_paths_relative_to(tmp_path / "elsewhere").to_yaml()


def test_a_scene_is_built_from_the_name_of_a_shipped_surface():
    scene, description = scene_from_surface(Path("chairs"), Placement(shape="chair-0000"), Container(), None, 5)
    assert description.startswith("chairs is 0.68 x")
    assert scene.surface.deepsdf.file == Path("chairs")


def test_an_unknown_name_raises_an_error_that_lists_the_shipped_ones():
    with pytest.raises(
        InputError, match=r"corl: there is no such file; give a file or a shipped surface \(bowls, chairs, coral\)"
    ):
        scene_from_surface(Path("corl"), Placement(), Container(), None, 5)
