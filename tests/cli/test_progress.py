import io
import sys
from types import SimpleNamespace

import pytest

from surfsup.cli import progress
from surfsup.cli.progress import ProgressLines, progress_bar
from surfsup.optim.stopping import Stop


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def open_terminal(monkeypatch):
    """Gives a test the terminal as its standard error; pytest sets its own between fixtures and test."""
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("TERM", "xterm")

    def open_terminal():
        terminal = Terminal()
        monkeypatch.setattr(sys, "stderr", terminal)
        return terminal

    return open_terminal


def test_a_bar_appears_with_its_first_update(open_terminal):
    terminal = open_terminal()
    with progress_bar("counting"):
        pass
    assert terminal.getvalue() == ""
    with progress_bar("counting") as bar:
        bar(1, 2)
        bar(2, 2)
    assert "counting" in terminal.getvalue()
    assert "2/2" in terminal.getvalue()
    assert "━" in terminal.getvalue()


@pytest.mark.parametrize(("seconds_left", "text"), [(3725.0, "1:02:0"), (-1.0, "0:00:00"), (None, "-:--:--")])
def test_a_bar_shows_the_remaining_time(seconds_left, text, open_terminal):
    terminal = open_terminal()
    with progress_bar("counting") as bar:
        bar(1, 100, seconds_left)
    assert text in terminal.getvalue()


@pytest.mark.parametrize("on_a_terminal", [True, False])
def test_a_report_shows_the_loss_and_keeps_the_validations(on_a_terminal, monkeypatch):
    error = Terminal() if on_a_terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", error)
    with progress_bar("training") as bar:
        bar.report(SimpleNamespace(step=1, steps=3, loss=0.5, seconds_left=2.0, validation="error 0.25 [m]"))
        bar.report(SimpleNamespace(step=2, steps=3, loss=0.125, seconds_left=1.0, validation=None))
    assert "step 1: error 0.25 [m]" in error.getvalue()
    assert "loss 0.125" in error.getvalue()
    assert "2/3" in error.getvalue()


class TestPlainLines:
    """Progress where standard error is no terminal."""

    @pytest.fixture
    def clock(self, monkeypatch):
        now = SimpleNamespace(seconds=0.0)
        monkeypatch.setattr(progress.time, "monotonic", lambda: now.seconds)
        return now

    def test_a_line_is_printed_every_five_seconds_and_at_the_end(self, clock, capsys):
        lines = ProgressLines("simulating")
        for second in range(13):
            clock.seconds = float(second)
            lines(second, 24)
        lines.close()
        assert capsys.readouterr().err.splitlines() == [
            "simulating: 5/24, 0:00:05, 0:00:19 left",
            "simulating: 10/24, 0:00:10, 0:00:14 left",
            "simulating: 12/24, 0:00:12, 0:00:12 left",
        ]

    def test_a_given_estimate_is_shown_and_none_without_progress(self, clock, capsys):
        lines = ProgressLines("training")
        clock.seconds = 6.0
        lines(0, 10)
        clock.seconds = 12.0
        lines(1, 10, 3725.0)
        assert capsys.readouterr().err.splitlines() == [
            "training: 0/10, 0:00:06",
            "training: 1/10, 0:00:12, 1:02:05 left",
        ]

    def test_the_end_is_printed_once_and_has_no_time_left(self, clock, capsys):
        with progress_bar("counting") as lines:
            lines(1, 2)
            lines(2, 2)
        assert capsys.readouterr().err == "counting: 2/2, 0:00:00\n"

    def test_nothing_is_printed_without_an_update(self, capsys):
        with progress_bar("counting"):
            pass
        assert capsys.readouterr().err == ""


def test_lines_estimate_the_time_left_from_the_steps_after_the_first(monkeypatch):
    error = io.StringIO()
    monkeypatch.setattr(sys, "stderr", error)
    clock = iter([0.0, 60.0, 66.0, 72.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(clock))
    lines = ProgressLines("rendering")
    lines(1, 12)
    lines(2, 12)
    lines(3, 12)
    assert error.getvalue().splitlines() == [
        "rendering: 1/12, 0:01:00",
        "rendering: 2/12, 0:01:06, 0:01:00 left",
        "rendering: 3/12, 0:01:12, 0:00:54 left",
    ]


def test_no_more_time_is_shown_as_left_than_the_limit(monkeypatch):
    error = io.StringIO()
    monkeypatch.setattr(sys, "stderr", error)
    stop = Stop(30)
    stop()
    with progress_bar("training", stop) as bar:
        bar.report(SimpleNamespace(step=1, steps=1000, loss=0.5, seconds_left=10_000, validation=None))
    assert "1/1000" in error.getvalue() and ("0:00:30 left" in error.getvalue() or "0:00:29 left" in error.getvalue())
