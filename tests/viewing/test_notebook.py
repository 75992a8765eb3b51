import html
import re

import pytest

import surfsup as sf
from surfsup import Block, InputError, Scene, Simulation


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("water") / "water.h5"
    Simulation(Scene(fluid=[Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))], frames=4), device="cpu").record(path)
    return path


def test_a_cell_shows_the_page_inside_a_frame(file):
    player = sf.show(file, height=300)
    cell = player._repr_html_()
    match = re.fullmatch(r'<iframe srcdoc="([^"]*)" style="width: 100%; height: 300px; border: 0"></iframe>', cell)
    assert html.unescape(match[1]) == player.page
    assert player.page.lstrip().startswith("<!DOCTYPE html>") or "<html" in player.page


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="there is no such trajectory file"):
        sf.show(tmp_path / "nothing.h5")
