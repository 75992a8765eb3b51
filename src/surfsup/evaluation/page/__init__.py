"""The report as one HTML page that needs no network: it contains all numbers, curves and videos."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

from surfsup.evaluation.report import Json
from surfsup.evaluation.scores import ALL
from surfsup.evaluation.videos import Example
from surfsup.viewing.html_page import script_json, write_html

STRIDE = 2  # frames from one value of a shown curve to the next
DIGITS = 5  # significant digits of a shown curve's values
SHOWN_CURVES = ("chamfer", "surface", "height", "energy")


def write_page(path: Path, report: Json, videos: Sequence[Example] = (), no_videos: str | None = None) -> None:
    """Write the page of ``report`` to ``path``.

    Args:
        path: of the page; :func:`surfsup.evaluation.videos.write_videos` puts the videos beside it.
        report: from :func:`surfsup.evaluation.report.evaluation_report`.
        videos: the examples that have a video.
        no_videos: why there are no videos, if they were requested.
    """
    data = {
        **report,
        "stride": STRIDE,
        "scenes": [{**scene, "curves": downsample(scene["curves"])} for scene in report["scenes"]],
        "videos": [video_entry(example, path.parent) for example in videos],
        "no_videos": no_videos,
    }
    template = files(__package__)
    values = {
        "TITLE": html.escape(f"Evaluation of {report['simulator']['name']}"),
        "STYLE": template.joinpath("report.css").read_text(encoding="utf-8"),
        "SCRIPT": template.joinpath("report.js").read_text(encoding="utf-8"),
        "REPORT": script_json(data),
    }
    write_html(path, template.joinpath("report.html"), values)


def downsample(curves: Json) -> Json:
    """Only the shown curves, with fewer frames and digits."""
    return {
        name: {
            key: values and [round_digits(value) for value in values[::STRIDE]] for key, values in curves[name].items()
        }
        for name in SHOWN_CURVES
    }


def round_digits(value: float | None) -> float | None:
    """The value with DIGITS significant digits."""
    return None if value is None else float(f"{value:.{DIGITS}g}")


def video_entry(example: Example, report: Path) -> Json:
    """One video as a data address, and its scene."""
    scene = example.scene
    video = base64.b64encode(example.file(report).read_bytes()).decode("ascii")
    return {
        "rank": example.rank,
        "data": scene.reference.data_set,
        "scene": scene.name,
        "surface": scene.evaluation.surface,
        "chamfer": scene.evaluation.scores[ALL]["chamfer"],
        "source": f"data:video/mp4;base64,{video}",
    }
