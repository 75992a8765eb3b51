from pathlib import Path
from types import SimpleNamespace

import pytest

from surfsup.cli.train import duration, result_of


def run_in(folder: Path, step: int, seconds: float, steps: int = 100_000):
    config = SimpleNamespace(validate_every=5000, steps=steps)
    return SimpleNamespace(folder=folder, step=step, seconds=seconds, config=config)


def test_a_run_that_is_too_short_says_when_there_will_be_weights(tmp_path):
    message = result_of(run_in(tmp_path, 100, 20.0))
    assert "the first validation after 5000 steps writes (at this rate after 17 minutes)" in message
    assert "continue with --resume and more --time" in message
    assert "after 1000 steps writes (at this rate after 200 s)" not in result_of(run_in(tmp_path, 0, 0.0, 1000))
    assert "after 1000 steps writes (at this rate after 3 minutes)" in result_of(run_in(tmp_path, 100, 20.0, 1000))


def test_a_run_with_weights_says_where_they_are(tmp_path):
    (tmp_path / "best.safetensors").touch()
    assert result_of(run_in(tmp_path, 6000, 900.0)) == f"best weights in {tmp_path / 'best.safetensors'}"


@pytest.mark.parametrize(("seconds", "text"), [(50, "50 s"), (950, "16 minutes"), (9000, "2.5 hours")])
def test_a_duration_has_a_unit_that_suits_it(seconds, text):
    assert duration(seconds) == text
