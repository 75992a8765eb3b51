"""How a fit ends: what is written, what is told, and by which status."""

import pytest
import typer

from surfsup.cli.fit_run import carry_out, stop_after
from surfsup.cli.status import INTERRUPTED
from surfsup.errors import InputError
from surfsup.fitting.exact import ExactSolid
from surfsup.fitting.siren_fit import SirenConfig, SirenFit, SirenTarget
from surfsup.fitting.siren_result import NothingInside
from surfsup.sdf import Sphere

SMALL = {"width": 8, "layers": 1, "batch": 16, "steps": 3, "judge_every": 2}


@pytest.fixture
def fitting(tmp_path):
    target = SirenTarget.of_solid(ExactSolid(Sphere(0.25)), samples=1000, seed=0)
    return SirenFit(SirenConfig(**SMALL), target, tmp_path / "ball.fit")


def write_nothing() -> list[str]:
    raise NothingInside("no inside yet")


def test_what_was_written_is_told_after_all_steps(fitting, capsys):
    carry_out(fitting, stop_after(""), False, lambda: ["written to ball"])
    assert capsys.readouterr().out.startswith("written to ball\n3 of 3 steps in ")


def test_interrupted_before_there_is_an_inside_it_ends_as_interrupted(fitting, capsys):
    stop = stop_after("")

    def write_after_a_signal() -> list[str]:
        stop.signaled = True
        return write_nothing()

    with pytest.raises(typer.Exit) as ended:
        carry_out(fitting, stop, False, write_after_a_signal)
    assert ended.value.exit_code == INTERRUPTED
    assert "no inside yet" in capsys.readouterr().out


def test_interrupted_before_the_first_step_likewise(fitting):
    stop = stop_after("")
    stop.signaled = True
    with pytest.raises(typer.Exit) as ended:
        carry_out(fitting, stop, False, write_nothing)
    assert ended.value.exit_code == INTERRUPTED


def test_a_fit_that_ends_without_an_inside_is_bad_input(fitting):
    with pytest.raises(InputError, match="no inside yet"):
        carry_out(fitting, stop_after(""), False, write_nothing)


def test_no_time_for_a_step_is_bad_input(fitting):
    with pytest.raises(InputError, match="give more --time"):
        carry_out(fitting, stop_after("0.000001s"), False, write_nothing)
