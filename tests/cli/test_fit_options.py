"""How a fit ends: what it writes, what it prints, and its exit status."""

import pytest

from surfsup.cli.fit_options import FitOptions, run_and_write
from surfsup.cli.options import stop_after
from surfsup.errors import InputError, Interrupted
from surfsup.fitting.exact_shape import ExactSurface
from surfsup.fitting.siren_fit import SirenConfig, SirenFit, SirenTarget
from surfsup.fitting.siren_result import NoInside
from surfsup.sdf import Sphere

SMALL = {"width": 8, "layers": 1, "batch": 16, "steps": 3, "validate_every": 2}


@pytest.fixture
def fit(tmp_path):
    target = SirenTarget.of_shape(ExactSurface(Sphere(0.25)), samples=1000, seed=0)
    return SirenFit(SirenConfig(**SMALL), target, tmp_path / "ball.fit")


def write_nothing() -> list[str]:
    raise NoInside("no inside yet")


def test_the_options_configure_the_fit(tmp_path):
    options = FitOptions(tmp_path / "ball.safetensors", ["width=24"], seed=3)
    config = options.configure(SirenConfig)
    assert (config.width, config.seed) == (24, 3)


def test_after_all_steps_the_written_files_are_printed(fit, capsys):
    run_and_write(fit, stop_after(""), False, lambda: ["written to ball"])
    assert capsys.readouterr().out.startswith("written to ball\n3 of 3 steps in ")


def test_an_interrupt_before_there_is_an_inside_has_the_status_of_an_interrupt(fit, capsys):
    stop = stop_after("")

    def write_after_a_signal() -> list[str]:
        stop.signaled = True
        return write_nothing()

    with pytest.raises(Interrupted, match="--resume continues"):
        run_and_write(fit, stop, False, write_after_a_signal)
    assert "no inside yet" in capsys.readouterr().out


def test_an_interrupt_before_the_first_step_has_the_status_of_an_interrupt(fit):
    stop = stop_after("")
    stop.signaled = True
    with pytest.raises(Interrupted, match="--resume continues"):
        run_and_write(fit, stop, False, write_nothing)


def test_a_fit_that_ends_without_an_inside_is_bad_input(fit):
    with pytest.raises(InputError, match="no inside yet"):
        run_and_write(fit, stop_after(""), False, write_nothing)


def test_a_time_limit_leaves_time_for_a_step_and_few_steps_are_said_to_be_of_no_use(fit, capsys):
    fit.config = fit.config.model_copy(update={"steps": 11})
    run_and_write(fit, stop_after("0.000001s"), False, lambda: [])
    assert fit.step == 1
    assert "not fit for water" in capsys.readouterr().out
