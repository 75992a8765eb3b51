import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from surfsup.evaluation.evaluate import evaluate
from surfsup.evaluation.load_trajectories import find_data_sets, load_references
from surfsup.evaluation.page import write_page
from surfsup.evaluation.report import EvaluationSettings, evaluation_report
from surfsup.evaluation.scores import METRICS
from surfsup.evaluation.videos import Example, select_examples, write_videos
from surfsup.learned.weights_file import Card
from surfsup.sph.solver import DfsphSolver
from tests.evaluation.scenes import FRAMES, free_fall, write

SETTINGS = EvaluationSettings("</script><b>bold", Card("bold", "a card with </script> in it & <i>more</i>"), True, 0.09)


class Reader(HTMLParser):
    """The elements of a page, the text of each script, and every address that an attribute names."""

    def __init__(self) -> None:
        super().__init__()
        self.tags, self.scripts, self.addresses, self.open = [], [], [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.addresses += [value for name, value in attributes if name in ("src", "href")]
        if tag == "script":
            self.scripts.append("")
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag == "script":
            self.open.pop()

    def handle_data(self, data):
        if self.open:
            self.scripts[-1] += data


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    """Four falls, each with another error, and one file that is not a trajectory."""
    folder = tmp_path_factory.mktemp("page")
    positions, velocities = free_fall()
    for number, offset in enumerate((0.004, 0.001, 0.003, 0.002)):
        offsets = np.zeros_like(positions)
        offsets[1:, :, 0] = offset  # the simulator has the reference's first frame and falls straight down
        write(folder / f"falls/{number}.h5", positions + offsets, velocities)
    write(folder / "falls/floor/1-1.h5", positions, velocities)
    (folder / "falls/broken.h5").write_text("no trajectory </script>")
    sets = find_data_sets([folder / "falls"])
    references, skipped = load_references(sets)
    scenes = evaluate(DfsphSolver(), "ballistic", references, folder / "report")
    return folder / "report", scenes, evaluation_report(SETTINGS, sets, scenes, skipped, folder / "report")


def read(page) -> tuple[str, Reader, dict]:
    text = page.read_text()
    reader = Reader()
    reader.feed(text)
    return text, reader, json.loads(reader.scripts[0])


def test_the_page_needs_no_other_file(evaluated):
    folder, _, report = evaluated
    write_page(folder / "report.html", report)
    text, reader, _ = read(folder / "report.html")
    assert "http" not in text.lower()
    assert reader.addresses == ["data:,"]
    assert not re.search(r"@import|url\(|__[A-Z]+__", text)
    assert reader.tags.count("script") == 2
    assert "</script><b>bold" not in text


def test_the_page_contains_the_numbers_the_curves_and_their_meaning(evaluated):
    folder, _, report = evaluated
    write_page(folder / "report.html", report, no_videos="no graphics here")
    _, _, data = read(folder / "report.html")
    assert data["means"] == report["means"]
    assert data["simulator"]["about"] == SETTINGS.card.about
    assert [one["description"] for one in data["metrics"]] == [metric.description for metric in METRICS]
    assert data["data"][0]["skipped"][0]["file"] == "broken.h5"
    assert data["no_videos"] == "no graphics here"
    shown, whole = data["scenes"][0]["curves"], report["scenes"][0]["curves"]
    assert len(shown["chamfer"]["prediction"]) == FRAMES / data["stride"]
    assert shown["height"]["reference"] == pytest.approx(whole["height"]["reference"][:: data["stride"]], rel=1e-4)
    assert shown["height"]["floor"] is None
    assert data["scenes"][1]["curves"]["height"]["floor"] is not None


def test_trajectories_are_linked_relative_to_the_page(evaluated):
    folder, _, report = evaluated
    for scene in report["scenes"]:
        assert (folder / scene["trajectory"]).is_file()


def test_best_median_and_worst_are_ranked_by_chamfer_distance(evaluated):
    _, scenes, _ = evaluated
    assert [(one.rank, one.scene.name) for one in select_examples(scenes)] == [
        ("best", "1"),
        ("median", "3"),
        ("worst", "0"),
    ]
    assert [(one.rank, one.scene.name) for one in select_examples(scenes[:2])] == [("best", "1"), ("worst", "0")]
    assert [(one.rank, one.scene.name) for one in select_examples(scenes[:1])] == [("best", "0")]


def test_a_video_is_rendered_and_embedded_in_the_page(evaluated):
    folder, scenes, report = evaluated
    example = Example("best", scenes[1])
    calls = []
    write_videos(folder, [example], "ballistic", lambda *call: calls.append(call))
    write_page(folder / "report.html", report, [example])
    _, _, data = read(folder / "report.html")
    (video,) = data["videos"]
    assert (video["rank"], video["scene"], video["surface"]) == ("best", "1", "sphere")
    assert video["source"].startswith("data:video/mp4;base64,")
    assert calls[-1] == (len(calls), len(calls))
