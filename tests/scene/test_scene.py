from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from surfsup.errors import InputError
from surfsup.scene import SPACING, SURFACE_CLEARANCE, Block, Container, Fluid, Scene, Shape
from surfsup.scene.shapes import BoxShape, ConeShape, CylinderShape, MeshShape, Rotation, SphereShape, TorusShape
from surfsup.sdf import Sphere

WATER = "fluid: [{block: {min: [-0.2, -0.2, 1.0], max: [0.2, 0.2, 1.4]}}]\n"


def scene(text: str) -> Scene:
    return Scene.from_yaml(text, "scene.yaml")


# Any scene that a file can hold, physical or not.
finite = st.floats(min_value=-1e4, max_value=1e4)
lengths = st.floats(min_value=0, max_value=1e4, exclude_min=True)
vectors = st.tuples(finite, finite, finite)
names = st.text(st.characters(categories=["L", "N", "P", "S", "Zs"]), min_size=1).map(Path)
kinds = st.one_of(
    st.builds(SphereShape, radius=lengths).map(lambda kind: {"sphere": kind}),
    st.builds(BoxShape, size=st.tuples(lengths, lengths, lengths)).map(lambda kind: {"box": kind}),
    st.builds(CylinderShape, radius=lengths, height=lengths).map(lambda kind: {"cylinder": kind}),
    st.builds(ConeShape, height=lengths, bottom_radius=lengths, top_radius=lengths).map(lambda kind: {"cone": kind}),
    st.builds(TorusShape, major_radius=lengths, minor_radius=lengths).map(lambda kind: {"torus": kind}),
    st.builds(MeshShape, file=names, fit=st.none() | lengths, up=st.sampled_from([None, "y", "z"])).map(
        lambda kind: {"mesh": kind}
    ),
)
rotations = st.builds(Rotation, axis=vectors.filter(lambda axis: max(map(abs, axis)) > 1e-12), degrees=finite)


def placed(kind: st.SearchStrategy[dict]) -> st.SearchStrategy[Shape]:
    return st.builds(
        lambda own, scale, rotate, at: Shape(**own, scale=scale, rotate=rotate, at=at),
        kind,
        lengths,
        st.none() | rotations,
        vectors,
    )


def combinations(parts: st.SearchStrategy[Shape]) -> st.SearchStrategy[Shape]:
    several = st.lists(parts, min_size=1, max_size=3)
    return placed(
        st.one_of(
            several.map(lambda parts: {"union": parts}),
            several.map(lambda parts: {"intersection": parts}),
            st.lists(parts, min_size=2, max_size=2).map(lambda parts: {"difference": parts}),
        )
    )


shapes = st.recursive(placed(kinds), combinations, max_leaves=5)
coordinates = st.floats(-100, 100)
sides = st.floats(2.1 * SPACING, 2)
blocks = st.builds(
    lambda low, size, velocity: Block(
        min=low, max=tuple(a + b for a, b in zip(low, size, strict=True)), velocity=velocity
    ),
    st.tuples(coordinates, coordinates, coordinates),
    st.tuples(sides, sides, sides),
    vectors,
)
scenes = st.builds(
    Scene,
    container=st.builds(Container, size=st.tuples(lengths, lengths, lengths)),
    surface=st.none() | shapes,
    fluid=st.lists(st.builds(Fluid, block=blocks), min_size=1, max_size=3),
    gravity=vectors,
    frames=st.integers(1, 10**9),
)


@given(scenes)
def test_a_scene_round_trips_through_yaml(original):
    assert scene(original.to_yaml()) == original


def test_yaml_omits_default_values():
    assert "gravity" not in scene(WATER).to_yaml()
    assert "frames: 7" in scene(WATER + "frames: 7").to_yaml()


def test_the_defaults_are_the_standard_container_and_gravity():
    standard = scene(WATER)
    assert standard.container.lower == (-0.5, -0.5, 0.0)
    assert standard.container.upper == (0.5, 0.5, 2.0)
    assert standard.gravity == (0.0, 0.0, -9.81)
    assert standard.frames == 800
    assert standard.build_surface() is None


def test_a_scene_file_that_is_missing_or_binary_or_a_folder_is_an_error_of_one_line(tmp_path):
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(bytes(range(256)))
    zeros = tmp_path / "zeros.yaml"
    zeros.write_bytes(b"fluid: \0\0\0")
    for path in (tmp_path / "missing.yaml", binary, zeros, tmp_path):
        with pytest.raises(InputError) as error:
            Scene.load(path)
        assert str(path) in str(error.value)
        assert "\n" not in str(error.value)


def test_a_byte_order_mark_is_ignored(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text("\ufeff" + WATER, encoding="utf-8")
    assert Scene.load(path).fluid == scene(WATER).fluid


def test_mesh_files_are_relative_to_the_scene_file(tmp_path):
    folder = tmp_path / "scenes"
    folder.mkdir()
    difference = "{difference: [{mesh: {file: a.obj}}, {sphere: {radius: 1}}]}"
    text = WATER + f"surface: {{union: [{{mesh: {{file: ../meshes/knot.obj}}}}, {difference}]}}"
    (folder / "scene.yaml").write_text(text)
    written = Scene.load(folder / "scene.yaml")
    elsewhere = written.with_paths_relative_to(tmp_path / "other").surface
    assert elsewhere.union[0].mesh.file == tmp_path / "meshes" / "knot.obj"
    assert elsewhere.union[1].difference[0].mesh.file == folder / "a.obj"
    assert elsewhere.union[1].difference[1].sphere.radius == 1


def test_paths_inside_the_root_folder_are_written_relative_to_the_new_file(tmp_path):
    (tmp_path / "scene.yaml").write_text(WATER + "surface: {mesh: {file: surfaces/a.obj}}")
    scene = Scene.load(tmp_path / "scene.yaml")
    moved = scene.with_paths_relative_to(tmp_path)
    assert moved.surface.mesh.file == Path("surfaces/a.obj")
    assert moved.with_paths_relative_to(tmp_path).surface == moved.surface
    assert moved.with_paths_relative_to(tmp_path / "deeper").surface.mesh.file == tmp_path / "surfaces" / "a.obj"
    assert moved.with_paths_relative_to(tmp_path / "deeper", tmp_path).surface.mesh.file == Path("../surfaces/a.obj")


def test_a_missing_mesh_is_reported_with_its_full_path(tmp_path):
    (tmp_path / "scene.yaml").write_text(WATER + "surface: {mesh: {file: absent.obj}}")
    with pytest.raises(InputError, match=str(tmp_path / "absent.obj")):
        Scene.load(tmp_path / "scene.yaml").build_surface()


def test_particles_in_the_solid_are_excluded_and_counted():
    made = scene(
        "surface: {sphere: {radius: 0.2}, at: [0, 0, 1.0]}\n"
        "fluid: [{block: {min: [-0.3, -0.3, 0.8], max: [0.3, 0.3, 1.2]}}]"
    )
    start = made.initial_particles(made.build_surface())
    every = made.fluid[0].block.positions()
    free = np.linalg.norm(every - [0, 0, 1.0], axis=1) - 0.2 >= SURFACE_CLEARANCE
    assert start.excluded == (~free).sum() > 0
    np.testing.assert_array_equal(start.positions, every[free])


def test_a_scene_without_particles_is_an_error():
    made = scene(WATER + "surface: {box: {size: [1, 1, 1]}, at: [0, 0, 1.2]}")
    with pytest.raises(InputError, match="all 1728 particles are inside the solid; move the block"):
        made.initial_particles(made.build_surface())


def test_a_solid_in_millimeters_that_swallows_the_water_is_named_with_its_size():
    made = scene(WATER + "surface: {box: {size: [200, 200, 150]}}")
    with pytest.raises(InputError, match="which is 200 x 200 x 150 m; if its file is in millimeters, give it scale"):
        made.initial_particles(made.build_surface())


@pytest.mark.parametrize(
    ("low", "high", "axis"),
    [
        ([-0.6, -0.2, 1.0], [0.2, 0.2, 1.4], "x"),
        ([-0.2, -0.2, 1.0], [0.2, 0.55, 1.4], "y"),
        ([-0.2, -0.2, 1.0], [0.2, 0.2, 2.1], "z"),
        ([-0.2, -0.2, -0.1], [0.2, 0.2, 0.4], "z"),
        ([-0.2, -0.2, 1.0], [0.2, 0.2, 300.0], "z"),
    ],
)
def test_a_block_outside_the_container_is_an_error_with_block_and_axis(low, high, axis):
    made = scene(
        f"fluid:\n- block: {{min: [-0.1, -0.1, 0.1], max: [0.1, 0.1, 0.3]}}\n- block: {{min: {low}, max: {high}}}\n"
    )
    with pytest.raises(InputError, match=f"block 1 reaches .* along {axis}, outside the container") as error:
        made.initial_particles(None)
    assert "\n" not in str(error.value)


def test_a_block_may_fill_the_container():
    full = scene(
        "container: {size: [0.3, 0.3, 0.3]}\nfluid: [{block: {min: [-0.15, -0.15, 0], max: [0.15, 0.15, 0.3]}}]"
    )
    assert len(full.initial_particles(None).positions) == 9**3


def test_overlapping_blocks_share_no_particle():
    twice = scene(
        "fluid:\n"
        "- block: {min: [-0.2, -0.2, 1.0], max: [0.2, 0.2, 1.4]}\n"
        "- block: {min: [-0.2, -0.2, 1.0], max: [0.2, 0.2, 1.4]}\n"
    ).initial_particles(None)
    assert (len(twice.positions), twice.excluded) == (12**3, 12**3)

    shifted = scene(
        "fluid:\n"
        "- block: {min: [-0.2, -0.2, 1.0], max: [0.2, 0.2, 1.4]}\n"
        "- block: {min: [-0.015, -0.2, 1.01], max: [0.385, 0.2, 1.41], velocity: [1, 0, 0]}\n"
    ).initial_particles(None)
    apart = torch.pdist(torch.from_numpy(shifted.positions).double())
    assert apart.min() > 0.9 * SPACING
    assert len(shifted.positions) + shifted.excluded == 2 * 12**3
    assert 0 < shifted.excluded < 12**3


def test_every_particle_has_the_velocity_of_its_block():
    start = scene(
        "fluid:\n"
        "- block: {min: [-0.2, -0.2, 1.0], max: [-0.1, -0.1, 1.1]}\n"
        "- block: {min: [0.1, 0.1, 1.0], max: [0.2, 0.2, 1.2], velocity: [1, -2, 3]}\n"
    ).initial_particles(None)
    assert [len(block) for block in start.block_positions] == [8, 20]
    np.testing.assert_array_equal(start.velocities, np.float32([[0, 0, 0]] * 8 + [[1, -2, 3]] * 20))
    assert start.positions.dtype == start.velocities.dtype == np.float32


def test_a_block_inside_the_solid_does_not_shift_the_velocities_of_others():
    made = scene(
        "surface: {box: {size: [0.3, 0.3, 0.3]}}\n"
        "fluid:\n"
        "- block: {min: [-0.1, -0.1, 0.0], max: [0.1, 0.1, 0.1], velocity: [9, 9, 9]}\n"
        "- block: {min: [-0.1, -0.1, 1.0], max: [0.1, 0.1, 1.1], velocity: [1, 2, 3]}\n"
    )
    start = made.initial_particles(made.build_surface())
    assert len(start.block_positions) == 1
    assert start.block_velocities == [(1.0, 2.0, 3.0)]


def test_a_base_folder_is_where_relative_paths_start(tmp_path):
    import trimesh

    trimesh.creation.box((0.2, 0.3, 0.4)).export(tmp_path / "box.obj")
    text = "surface: {mesh: {file: box.obj}}\nfluid: [{block: {min: [-0.2, -0.2, 1], max: [0.2, 0.2, 1.4]}}]\n"
    scene = Scene.from_yaml(text, "scene.yaml", tmp_path / "elsewhere")
    with pytest.raises(InputError, match=r"box\.obj: cannot be read"):
        scene.build_surface()
    for moved in (scene.with_base_folder(tmp_path), scene.with_base_folder(tmp_path).with_frames(3)):
        assert moved.build_surface().bounds()[1, 1] == pytest.approx(0.15)


def test_a_scene_in_python_takes_blocks_or_entries_of_a_file():
    block = Block((-0.2, -0.2, 1.0), (0.2, 0.2, 1.4))
    assert Scene(fluid=[block]) == Scene(fluid=[Fluid(block=block)]) == scene(WATER)


def test_a_scene_in_python_takes_a_surface_object():
    ball = Sphere(0.2)
    made = Scene(surface=ball, fluid=[Block((-0.3, -0.3, 0.0), (0.3, 0.3, 0.4))])
    assert made.build_surface() is ball
    assert made.surface_kind == "object"
    assert made.initial_particles(ball).excluded > 0
    assert made.with_frames(3).with_base_folder(Path("elsewhere")).build_surface() is ball


def test_the_kind_of_a_surface_is_its_key_or_none():
    assert scene(WATER).surface_kind == "none"
    assert scene(WATER + "surface: {sphere: {radius: 1}}").surface_kind == "sphere"


def test_a_surface_object_without_a_file_cannot_be_written():
    made = Scene(surface=Sphere(0.2), fluid=[Block((-0.2, -0.2, 1.0), (0.2, 0.2, 1.4))])
    with pytest.raises(InputError, match="a file cannot describe its surface, a Sphere object; give a Shape") as error:
        made.with_paths_relative_to(Path()).to_yaml()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"fluid": []}, "Scene: fluid: is empty, and there are no taps"),
        ({"fluid": [Block((0, 0, 0), (1, 1, 1))], "frames": 0}, "Scene: frames: Input should be greater than"),
        ({"fluid": [Block((0, 0, 0), (1, 1, 1))], "surface": "cup.stl"}, "Scene: surface: must be a mapping with keys"),
    ],
)
def test_an_invalid_scene_in_python_is_an_error_of_one_line(values, message):
    with pytest.raises(InputError) as error:
        Scene(**values)
    assert str(error.value).startswith(message)
    assert "\n" not in str(error.value)


def test_a_scene_is_loaded_from_a_path_as_text(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(WATER)
    assert Scene.load(str(path)) == Scene.load(path)
