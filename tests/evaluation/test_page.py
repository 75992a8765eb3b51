import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from surfsup.evaluation.evaluate import evaluate
from surfsup.evaluation.load_trajectories import data_sets, usable_truths
from surfsup.evaluation.page import write_page
from surfsup.evaluation.report import Subject, evaluation_report
from surfsup.evaluation.scores import METRICS
from surfsup.evaluation.videos import Example, examples, write_videos
from surfsup.learned.weights_file import Card
from tests.evaluation.scenes import FRAMES, free_fall, silent, write

SUBJECT = Subject(Card("</script><b>bold", "a card with </script> in it & <i>more</i>"), True, 0.09)


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
def judged(tmp_path_factory):
    """Four falls, judged with models that are off by ever more, and one file that is none."""
    folder = tmp_path_factory.mktemp("page")
    positions, velocities = free_fall()
    for number, off in enumerate((0.004, 0.001, 0.003, 0.002)):
        aside = np.zeros_like(positions)
        aside[1:, :, 0] = off  # the model starts where the truth does, and falls straight
        write(folder / f"falls/{number}.h5", positions + aside, velocities)
    write(folder / "falls/floor/1-1.h5", positions, velocities)
    (folder / "falls/broken.h5").write_text("no trajectory </script>")
    sets = data_sets([folder / "falls"])
    truths, skipped = usable_truths(sets)
    scenes = evaluate(silent(), "silent", truths, folder / "report", "cpu")
    return folder / "report", scenes, evaluation_report(SUBJECT, sets, scenes, skipped, folder / "report")


def read(page) -> tuple[str, Reader, dict]:
    text = page.read_text()
    reader = Reader()
    reader.feed(text)
    return text, reader, json.loads(reader.scripts[0])


def test_the_page_is_whole_in_itself(judged):
    folder, _, report = judged
    write_page(folder / "report.html", report)
    text, reader, _ = read(folder / "report.html")
    assert "http" not in text.lower()
    assert reader.addresses == ["data:,"]
    assert not re.search(r"@import|url\(|__[A-Z]+__", text)
    assert reader.tags.count("script") == 2
    assert "</script><b>bold" not in text


def test_the_page_holds_the_numbers_the_curves_and_what_they_mean(judged):
    folder, _, report = judged
    write_page(folder / "report.html", report, no_videos="no graphics here")
    _, _, data = read(folder / "report.html")
    assert data["means"] == report["means"]
    assert data["model"]["about"] == SUBJECT.card.about
    assert [one["tells"] for one in data["metrics"]] == [metric.tells for metric in METRICS]
    assert data["data"][0]["skipped"][0]["file"] == "broken.h5"
    assert data["no_videos"] == "no graphics here"
    shown, whole = data["scenes"][0]["curves"], report["scenes"][0]["curves"]
    assert len(shown["chamfer"]["model"]) == FRAMES / data["stride"]
    assert shown["height"]["truth"] == pytest.approx(whole["height"]["truth"][:: data["stride"]], rel=1e-4)
    assert shown["height"]["floor"] is None
    assert data["scenes"][1]["curves"]["height"]["floor"] is not None


def test_trajectories_are_linked_relative_to_the_page(judged):
    folder, _, report = judged
    for scene in report["scenes"]:
        assert (folder / scene["trajectory"]).is_file()


def test_best_median_and_worst_are_by_chamfer_distance(judged):
    _, scenes, _ = judged
    assert [(one.rank, one.scene.name) for one in examples(scenes)] == [("best", "1"), ("median", "3"), ("worst", "0")]
    assert [(one.rank, one.scene.name) for one in examples(scenes[:2])] == [("best", "1"), ("worst", "0")]
    assert [(one.rank, one.scene.name) for one in examples(scenes[:1])] == [("best", "0")]


def test_a_video_is_drawn_and_put_into_the_page(judged):
    folder, scenes, report = judged
    example = Example("best", scenes[1])
    told = []
    write_videos(folder, [example], "silent", lambda *now: told.append(now))
    write_page(folder / "report.html", report, [example])
    _, _, data = read(folder / "report.html")
    (video,) = data["videos"]
    assert (video["rank"], video["scene"], video["surface"]) == ("best", "1", "sphere")
    assert video["source"].startswith("data:video/mp4;base64,")
    assert told[-1] == (len(told), len(told))
