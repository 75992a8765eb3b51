from types import SimpleNamespace

import pytest

from surfsup.cli.progress import progress_bar


def test_a_bar_appears_with_its_first_update(capsys):
    with progress_bar("counting"):
        pass
    assert capsys.readouterr().err == ""
    with progress_bar("counting") as bar:
        bar(1, 2)
        bar(2, 2)
    error = capsys.readouterr().err
    assert "counting" in error
    assert "2/2" in error


@pytest.mark.parametrize(("seconds_left", "text"), [(3725.0, "1:02:0"), (-1.0, "0:00:00"), (None, "-:--:--")])
def test_a_bar_shows_the_remaining_time(seconds_left, text, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    with progress_bar("counting") as bar:
        bar(1, 100, seconds_left)
    assert text in capsys.readouterr().err


def test_a_report_shows_the_loss_and_keeps_the_validations(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    with progress_bar("training") as bar:
        bar.report(SimpleNamespace(step=1, steps=3, loss=0.5, seconds_left=2.0, validation="error 0.25 [m]"))
        bar.report(SimpleNamespace(step=2, steps=3, loss=0.125, seconds_left=1.0, validation=None))
    error = capsys.readouterr().err
    assert "step 1: error 0.25 [m]\n" in error
    assert "loss 0.125" in error
    assert "2/3" in error
