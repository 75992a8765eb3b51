import numpy as np
import pytest
import trimesh

from surfsup import InputError, Scene
from surfsup.scene.assembly import write_assembly


def boxes():
    """A large box, and a small one that stands on it, beside the middle; z is up."""
    large = trimesh.creation.box((2, 1, 1), trimesh.transformations.translation_matrix((5, 0, 0.5)))
    small = trimesh.creation.box((0.4, 0.4, 1), trimesh.transformations.translation_matrix((5.5, 0, 1.5)))
    return {"large": large, "small": small}


@pytest.fixture(params=["folder", "glb"])
def source(request, tmp_path):
    """The same assembly as a folder of files, and as a scene of nodes with y up."""
    if request.param == "folder":
        folder = tmp_path / "parts"
        folder.mkdir()
        for name, mesh in boxes().items():
            mesh.export(folder / f"{name}.stl")
        (folder / "notes.txt").write_text("no mesh")
        return folder
    scene = trimesh.Scene()
    to_y_up = trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0))
    for name, mesh in boxes().items():
        scene.add_geometry(mesh, node_name=name, geom_name=f"{name}-geometry", transform=to_y_up)
    path = tmp_path / "parts.glb"
    scene.export(path)
    return path


def bounds_of(scene):
    return {name: entry.surface(scene.base_folder).bounds().numpy() for name, entry in scene.surfaces.items()}


def test_each_part_is_a_solid_and_the_whole_is_fitted(source, tmp_path):
    out = tmp_path / "scene.yaml"
    assert sorted(write_assembly(source, out, fit=0.5)) == ["large", "small"]
    scene = Scene.load(out)
    bounds = bounds_of(scene)  # scaled by 0.5 / 2, the largest extent of the whole
    np.testing.assert_allclose(bounds["large"], [[-0.25, -0.125, 0], [0.25, 0.125, 0.25]], atol=1e-6)
    np.testing.assert_allclose(bounds["small"], [[0.075, -0.05, 0.25], [0.175, 0.05, 0.5]], atol=1e-6)
    assert scene.surfaces["small"].at == pytest.approx((0.125, 0, 0.375))  # the middle, about which a motion turns it
    assert scene.fluid[0].block.min[2] > 0.5
    assert len(scene.initial_particles(scene.build_surface()).positions) > 100


def test_coordinates_are_kept_on_request(tmp_path):
    folder = tmp_path / "parts"
    folder.mkdir()
    trimesh.creation.box((0.2, 0.2, 0.2), trimesh.transformations.translation_matrix((0.1, 0, 0.3))).export(
        folder / "a.ply"
    )
    write_assembly(folder, tmp_path / "scene.yaml", fit=None)
    (bounds,) = bounds_of(Scene.load(tmp_path / "scene.yaml")).values()
    np.testing.assert_allclose(bounds, [[0, -0.1, 0.2], [0.2, 0.1, 0.4]], atol=1e-6)


def test_names_are_made_to_differ_and_to_suit_files(tmp_path):
    scene = trimesh.Scene()
    for number, name in enumerate(("a cup/left", "a cup left", "container")):
        place = trimesh.transformations.translation_matrix((number, 0, 0))
        scene.add_geometry(trimesh.creation.box((0.5, 0.5, 0.5)), node_name=name, transform=place)
    scene.export(tmp_path / "parts.glb")
    names = write_assembly(tmp_path / "parts.glb", tmp_path / "scene.yaml", fit=0.6)
    assert sorted(names) == ["a-cup-left", "a-cup-left-2", "container-2"]


@pytest.mark.parametrize("content", [b"", b"glTF"])
def test_a_damaged_file_is_refused_in_one_line(tmp_path, content):
    (tmp_path / "a.glb").write_bytes(content)
    with pytest.raises(InputError) as error:
        write_assembly(tmp_path / "a.glb", tmp_path / "scene.yaml", fit=0.6)
    assert "\n" not in str(error.value)
    assert not (tmp_path / "scene.yaml").exists()


def test_a_folder_without_meshes_and_an_assembly_that_does_not_fit_are_refused(tmp_path):
    folder = tmp_path / "parts"
    folder.mkdir()
    with pytest.raises(InputError, match="has no parts; a folder needs mesh files"):
        write_assembly(folder, tmp_path / "scene.yaml", fit=0.6)
    trimesh.creation.box((3, 3, 3)).export(folder / "a.stl")
    with pytest.raises(InputError, match="a"):
        write_assembly(folder, tmp_path / "scene.yaml", fit=None)
    assert not (tmp_path / "scene.yaml").exists()
