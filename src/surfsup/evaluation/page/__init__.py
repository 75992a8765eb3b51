"""The report as one page that needs no network: numbers, curves and videos are all in it."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from surfsup.evaluation.evaluate import JudgedScene
from surfsup.evaluation.scores import ALL
from surfsup.evaluation.videos import Example

STRIDE = 2  # every so many-th frame of a curve is in the page; the screen shows no more
DIGITS = 5
SHOWN = ("chamfer", "surface", "height", "energy")


def write_page(path: Path, report: dict, videos: Sequence[Example] = (), no_videos: str | None = None) -> None:
    """Write the page of ``report`` to ``path``.

    Args:
        path: of the page; videos lie where :func:`surfsup.evaluation.videos.write_videos` put them beside it.
        report: as :func:`surfsup.evaluation.report.evaluation_report` gives it.
        videos: which examples have a video.
        no_videos: why there are none, where they were wanted.
    """
    data = {
        **report,
        "stride": STRIDE,
        "scenes": [{**scene, "curves": thinned(scene["curves"])} for scene in report["scenes"]],
        "videos": [video_entry(example, path.parent) for example in videos],
        "no_videos": no_videos,
    }
    # Inside a script element the text must not end it; JSON may write the bracket as its number.
    text = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    page = files(__package__)
    filled = page.joinpath("report.html").read_text(encoding="utf-8")
    for place, content in (
        ("__TITLE__", html.escape(f"{report['model']['name']} judged")),
        ("__STYLE__", page.joinpath("report.css").read_text(encoding="utf-8")),
        ("__SCRIPT__", page.joinpath("report.js").read_text(encoding="utf-8")),
        ("__REPORT__", text),
    ):
        filled = filled.replace(place, content, 1)
    partial = path.with_name(f".{path.name}.partial")
    partial.write_text(filled, encoding="utf-8")
    partial.replace(path)


def thinned(curves: dict) -> dict:
    """Fewer frames, fewer digits, and of the curves only those that are drawn."""
    return {
        name: {who: values and [shorter(value) for value in values[::STRIDE]] for who, values in curves[name].items()}
        for name in SHOWN
    }


def shorter(value: float | None) -> float | None:
    """A value with as many digits as a screen can show."""
    return None if value is None else float(f"{value:.{DIGITS}g}")


def video_entry(example: Example, report: Path) -> dict:
    """One video, whole, and what it shows."""
    scene: JudgedScene = example.scene
    video = base64.b64encode(example.file(report).read_bytes()).decode("ascii")
    return {
        "rank": example.rank,
        "data": scene.truth.data,
        "scene": scene.name,
        "surface": scene.judgment.surface,
        "chamfer": scene.judgment.scores[ALL]["chamfer"],
        "source": f"data:video/mp4;base64,{video}",
    }
