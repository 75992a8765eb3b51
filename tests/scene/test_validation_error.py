import time

import pytest

from surfsup.errors import InputError
from surfsup.scene import Scene

WATER = "fluid: [{block: {min: [-0.2, -0.2, 1.0], max: [0.2, 0.2, 1.4]}}]\n"


def message(text: str) -> str:
    with pytest.raises(InputError) as error:
        Scene.from_yaml(text, "my.yaml")
    line = str(error.value)
    assert "\n" not in line
    assert line.startswith("my.yaml: ")
    return line.removeprefix("my.yaml: ")


@pytest.mark.parametrize(
    ("text", "key", "nearest"),
    [
        (WATER + "surfase: {sphere: {radius: 1}}", "surfase", "surface"),
        ("fluids: []", "fluids", "fluid"),
        (WATER + "container: {sise: [1, 1, 1]}", "container.sise", "size"),
        (WATER + "surface: {shpere: {radius: 1}}", "surface.shpere", "sphere"),
        (WATER + "surface: {sphere: {raduis: 1}}", "surface.sphere.raduis", "radius"),
        (WATER + "surface: {sphere: {radius: 1}, rotate: {axes: [0, 0, 1]}}", "surface.rotate.axes", "axis"),
        (WATER + "surface: {union: [{mesh: {flie: a.obj}}]}", "surface.union.0.mesh.flie", "file"),
        (
            WATER + "surface: {union: [{sphere: {radius: 1}}, {difference: [{torus: {major_radios: 1}}]}]}",
            "surface.union.1.difference.0.torus.major_radios",
            "major_radius",
        ),
        ("fluid: [{blok: {}}]", "fluid.0.blok", "block"),
        (WATER + "surfaces: {cup: {sphere: {raduis: 0.1}}}", "surfaces.cup.sphere.raduis", "radius"),
        ("fluid: [{block: {min: [0, 0, 0], maxx: [1, 1, 1]}}]", "fluid.0.block.maxx", "max"),
    ],
)
def test_an_unknown_key_is_reported_with_the_closest_valid_one(text, key, nearest):
    assert message(text) == f"unknown key '{key}'; did you mean '{nearest}'?"


def test_an_unknown_key_without_a_close_match_is_reported_with_all_valid_keys():
    assert message(WATER + "qqq: 1") == (
        "unknown key 'qqq'; known are container, surface, surfaces, fluid, gravity, frames, particle_radius, fps, "
        "duration, restart, taps, drains, forces, density, liquid"
    )


def test_an_unknown_key_of_several_lines_makes_a_message_of_one_line():
    assert "unknown key" in message(WATER + '"sur\\nface": 1')


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("", "a scene is a mapping"),
        ("[1, 2]", "a scene is a mapping"),
        ("just words", "a scene is a mapping"),
        ("frames: 8", "fluid"),
        ("fluid: []", "fluid"),
        ("fluid: water", "fluid"),
        ("fluid: [water]", "fluid.0"),
        ("fluid: [{block: {min: [0, 0, 0]}}]", "fluid.0.block.max"),
        ("fluid: [{block: {min: [0, 0], max: [1, 1, 1]}}]", "fluid.0.block.min"),
        ("fluid: [{block: {min: [0, 0, .nan], max: [1, 1, 1]}}]", "fluid.0.block.min.2"),
        ("fluid: [{block: {min: [0, 0, 0], max: [1, 1, .inf]}}]", "fluid.0.block.max.2"),
        (
            "fluid: [{block: {min: [0, 0, 0], max: [1, 1, 0.05]}}]",
            "fluid.0.block: block is 0.05 m thick along z",
        ),
        (
            "fluid: [{block: {min: [0, 0, 0], max: [1, -1, 1]}}]",
            "fluid.0.block: min is above max along y (0 and -1); exchange them",
        ),
        ("fluid: [{block: {min: [0, 0, 0], max: [1e4, 100, 1]}}]", "fluid.0.block: block would hold more than"),
        (
            "fluid: [{block: {min: [0, 0, 0], max: [30, 30, 3]}}]\nparticle_radius: 0.003",
            "namely 1.25e+10; make it smaller",
        ),
        (
            "fluid: [{block: {min: [0, 0, -1e308], max: [1, 1, 1e308]}}]",
            "fluid.0.block.min.2: Input should be greater than or equal to -10000",
        ),
        (WATER + "gravity: [0, 0]", "gravity"),
        (WATER + "gravity: [0, 0, -.inf]", "gravity.2"),
        (WATER + "frames: 0", "frames"),
        (WATER + "frames: 1.5", "frames"),
        (WATER + "frames: " + "9" * 5000, ""),
        (WATER + "container: {size: [1, 1, 0]}", "container.size.2"),
        (WATER + "container: {size: 1}", "container.size"),
        (WATER + "surface: sphere", "surface"),
        (WATER + "surface: {}", "surface: needs exactly one kind of surface"),
        (WATER + "surface: {at: [0, 0, 1]}", "found none"),
        (WATER + "surface: {sphere: {radius: 1}, box: {size: [1, 1, 1]}}", "found sphere and box"),
        (WATER + "surface: {sphere: {radius: -1}}", "surface.sphere.radius"),
        (WATER + "surface: {sphere: {radius: .nan}}", "surface.sphere.radius"),
        (WATER + "surface: {sphere: {radius: wide}}", "surface.sphere.radius"),
        (WATER + "surface: {sphere: 0.3}", "surface.sphere: must be a mapping with keys out of radius"),
        (WATER + "surface: {sphere: {radius: 1}, scale: 0}", "surface.scale"),
        (WATER + "surface: {sphere: {radius: 1}, at: [0, 0]}", "surface.at"),
        (
            WATER + "surface: {sphere: {radius: 1}, rotate: {axis: [0, 0, 0], degrees: 9}}",
            "axis must not be zero",
        ),
        (WATER + "surface: {sphere: {radius: 1}, rotate: {axis: [0, 0, 1]}}", "surface.rotate.degrees"),
        (WATER + "surface: {mesh: {file: a.obj, up: x}}", "surface.mesh.up"),
        (
            WATER + "surface: {bowl: {capture_radius: 0.2, filter_radius: 0.2}}",
            "surface.bowl: filter_radius 0.2 must be smaller than capture_radius 0.2",
        ),
        (WATER + "surface: {funnel: {capture_radius: 0.2, filter_radius: 0}}", "surface.funnel.filter_radius"),
        (WATER + "surface: {heightfield: {file: a.png, size: [1, 0], height: 1}}", "surface.heightfield.size.1"),
        (WATER + "surface: {union: []}", "surface.union"),
        (
            WATER + "surface: {union: [{sphere: {radius: 1}}, {sphere: {radius: 0}}]}",
            "surface.union.1.sphere.radius",
        ),
        (WATER + "surface: {difference: [{sphere: {radius: 1}}]}", "surface.difference"),
    ],
)
def test_an_invalid_value_is_reported_with_its_place(text, place):
    assert place in message(text)


def test_a_long_value_is_truncated():
    assert len(message(WATER + "frames: " + "x" * 10_000)) < 250


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("fluid: [", "line 1 is not YAML"),
        ("a: 1\nb: [}", "line 2 is not YAML"),
        ("a: !!python/object/apply:os.system [ls]", "line 1 is not YAML"),
        ("a: \x00", "is not YAML"),
        ("frames: 2001-99-99", "is not YAML"),
        ("frames: !!timestamp never", "is not YAML"),
        ("frames: !!int many", "is not YAML"),
        ("? [1, 2]\n: 3", "is not YAML"),
        (WATER + WATER, "line 2 is not YAML: key 'fluid' occurs twice"),
        ("a: " + "[" * 5000 + "]" * 5000, "nested too deep"),
    ],
)
def test_anything_but_plain_yaml_is_an_error(text, reason):
    assert reason in message(text)


def test_aliases_are_an_error_before_they_expand():
    laughs = "\n".join(
        ["a0: &a0 {sphere: {radius: 1}}"]
        + [f"a{n}: &a{n} {{union: [{', '.join([f'*a{n - 1}'] * 9)}]}}" for n in range(1, 12)]
        + ["surface: *a11", WATER]
    )
    began = time.monotonic()
    assert "aliases are not allowed" in message(laughs)
    assert "aliases are not allowed" in message("fluid: &self [*self]")
    assert time.monotonic() - began < 1


def test_a_deeply_nested_surface_is_read_or_an_error_but_never_a_crash():
    def nested(depth: int) -> str:
        return WATER + "surface: " + "{union: [" * depth + "{sphere: {radius: 1}}" + "]}" * depth

    assert Scene.from_yaml(nested(20), "my.yaml").surface is not None
    message(nested(2000))
