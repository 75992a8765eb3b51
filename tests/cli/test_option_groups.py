import inspect
from dataclasses import dataclass
from typing import Annotated

import pytest
import typer

from surfsup.cli.option_groups import expand_option_groups
from surfsup.cli.reference import reference
from surfsup.cli.simulate import simulate


@dataclass(frozen=True)
class Size:
    width: Annotated[int, typer.Argument(min=1)]
    height: Annotated[int, typer.Option("--tall")] = 2


@pytest.fixture
def program():
    calls = []
    app = typer.Typer()

    def draw(size: Size, color: Annotated[str, typer.Option()] = "blue") -> None:
        """Draw a box."""
        calls.append((size, color))

    app.command()(expand_option_groups(draw))

    def run(*arguments: str):
        calls.clear()
        assert app(arguments, standalone_mode=False) in (None, 0)
        return calls[0]

    return run


def test_the_fields_of_a_dataclass_are_options_of_the_command(program):
    assert program("3") == (Size(3, 2), "blue")
    assert program("3", "--tall", "5", "--color", "red") == (Size(3, 5), "red")


def test_the_options_of_a_field_apply(program):
    with pytest.raises(typer.TyperException, match="greater than or equal to 1"):
        program("0")


def test_a_command_keeps_name_and_help_of_its_verb():
    command = expand_option_groups(simulate)
    assert command.__name__ == "simulate"
    assert "Example: surfsup simulate" in command.__doc__


def test_simulate_and_reference_take_the_same_scene_and_output():
    shared = [inspect.signature(expand_option_groups(verb)).parameters for verb in (simulate, reference)]
    own = {"simulator_name", "fast", "device", "no_collisions", "resume"}, {"threads"}
    assert set(shared[0]) - own[0] == set(shared[1]) - own[1]
    assert len(set(shared[0]) & set(shared[1])) == 22
