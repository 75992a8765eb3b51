from pathlib import Path

import pytest
import torch

from surfsup.errors import InputError
from surfsup.scene import Scene
from surfsup.scene.mesh_scene import Placing, pour_on
from surfsup.scene.scene import Container
from surfsup.sdf import load_deepsdf, load_siren, resolve, shipped_surfaces
from surfsup.sdf.neural.shipped_surfaces import seen_from

FAMILIES = {"chairs": 500, "bowls": 200}
MOST = 10_000_000  # bytes of all of them


def test_a_coral_and_two_families_ship_each_with_a_card_and_small():
    files = shipped_surfaces()
    assert set(files) == {"bowls", "chairs", "coral"}
    assert sum(path.stat().st_size for path in files.values()) < MOST
    for name, path in files.items():
        assert path.with_suffix(".md").read_text().startswith(f"# {name}\n")


def test_the_coral_is_solid_in_its_middle_and_free_beside_it():
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


def test_a_name_means_the_shipped_one_wherever_a_file_is_named():
    assert resolve(Path("coral")) == shipped_surfaces()["coral"]
    assert resolve(Path("own/coral")) == Path("own/coral")
    assert resolve(Path("coral.safetensors")) == Path("coral.safetensors")
    assert seen_from(Path("scenes"), Path("coral")) == Path("coral")
    assert seen_from(Path("scenes"), Path("mine.safetensors")) == Path("scenes/mine.safetensors")


def test_a_scene_may_name_it_and_keeps_the_name(tmp_path):
    water = "fluid: [{block: {min: [-0.1, -0.1, 0.8], max: [0.1, 0.1, 1.0]}}]"
    (tmp_path / "scene.yaml").write_text(f"surface: {{siren: {{file: coral, fit: 0.7}}}}\n{water}\n")
    scene = Scene.load(tmp_path / "scene.yaml")
    assert float(scene.build_surface().bounds()[0, 2]) == pytest.approx(0.0, abs=1e-6)
    assert "file: coral" in scene.with_files_from(tmp_path / "elsewhere").to_yaml()


def test_water_is_poured_on_one_by_its_name():
    scene, said = pour_on(Path("chairs"), Placing(shape="chair-0000"), Container(), None, 5)
    assert said.startswith("chairs stands")
    assert scene.surface.deepsdf.file == Path("chairs")


def test_a_name_that_does_not_ship_is_answered_with_those_that_do():
    with pytest.raises(InputError, match="corl: there is no such file; surfaces that ship are bowls, chairs, coral"):
        pour_on(Path("corl"), Placing(), Container(), None, 5)
