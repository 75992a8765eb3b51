"""Tables 1 and 2 of the paper's supplement with this project's numbers, and the training curves over compute.

    python benchmarks/side_by_side.py REPORTS [--runs runs/side runs/side-on] [--figure docs/images/side-by-side.png]

REPORTS holds a folder of `surfsup evaluate` for each preset, with collision handling and without: surfsup,
surfsup-no-collisions, gns and so on. RUNS hold the trainings under the names of the presets, for the figure: Chamfer
distance of the rollouts on validation scenes over steps and over the time of training. Of several runs each continued
the one before. The tables are Markdown.
"""

from __future__ import annotations

import argparse
import csv
import json
from pathlib import Path
from typing import Any

PRESETS = ("surfsup", "gns", "value-only", "no-sdf")
WINDOW = "all"
# Table 2: Chamfer, Chamfer Surface and number inside on Prim-Shapes.
PAPER_PRIMITIVES = {
    "surfsup": ("0.0297", "4.704", "0"),
    "value-only": ("0.0319", "10.782", "30433"),
    "no-sdf": ("0.0815", "45.463", "193071"),
}
# Table 1: Chamfer, Chamfer Surface, Surface Penetration and Mean Inside Surface of surfsup and the baseline. The solids
# of the paper have the same names but other shapes. Of its two lions the second is taken: the first repeats other rows.
PAPER_SCENES = {
    ("00000", "coral"): {"surfsup": "0.096 / 119.79 / 6782 / -0.0028", "gns": "0.380 / 602.66 / 102783 / -0.051"},
    ("00001", "room"): {"surfsup": "0.1153 / 125.39 / 9526 / -0.0065", "gns": "1.1133 / 877.55 / 36106 / -0.0181"},
    ("00002", "lion"): {"surfsup": "0.0437 / 16.74 / 16899 / -0.0153", "gns": "0.0645 / 74.65 / 379329 / -0.0273"},
}
PLACES = {"chamfer": 4, "surface_squared": 2, "penetration": 0, "depth": 4, "lost": 0, "height": 3, "energy": 2}


def read(report: Path) -> dict[str, Any] | None:
    """The report in a folder, None where there is none."""
    path = report / "report.json"
    return json.loads(path.read_text()) if path.is_file() else None


def text_of(values: dict[str, Any], key: str) -> str:
    """A metric of the simulator as text."""
    value = values[key]["prediction"]
    return "lost" if value is None and key != "depth" else "–" if value is None else f"{value:.{PLACES[key]}f}"


def window_of(entry: dict[str, Any]) -> dict[str, Any]:
    """The longest window that an entry reaches."""
    return entry["windows"][WINDOW]


def means_of(report: dict[str, Any], data: str) -> dict[str, Any] | None:
    """The means over all scenes of a data set."""
    found = [entry for entry in report["means"] if entry["data"] == data and entry["surface"] == "all"]
    return window_of(found[0]) if found else None


def table(header: list[str], rows: list[list[str]]) -> str:
    """Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def data_sets(reports: dict[str, dict[str, Any]]) -> str:
    """Every data set and preset: Chamfer, height, energy, inside and lost."""
    names = list(dict.fromkeys(one["name"] for report in reports.values() for one in report["data"]))
    rows = []
    for data in names:
        for name, report in reports.items():
            means = means_of(report, data)
            if means is not None:
                keys = ("chamfer", "surface_squared", "height", "energy", "penetration", "lost")
                ratio = means["chamfer"]["ratio"]
                beside = "" if ratio is None else f"{ratio:.2f}"
                rows.append(
                    [
                        data,
                        name,
                        *[text_of(means, key) for key in keys[:1]],
                        beside,
                        *[text_of(means, k) for k in keys[1:]],
                    ]
                )
    header = [
        "data set",
        "model",
        "Chamfer, m",
        "over the floor",
        "Surface, m²",
        "height error, m",
        "energy",
        "inside",
        "lost",
    ]
    return table(header, rows)


def ablation(reports: dict[str, dict[str, Any]], data: str) -> str:
    """Table 2."""
    rows = []
    for name, report in reports.items():
        means = means_of(report, data)
        if means is not None:
            paper = PAPER_PRIMITIVES.get(name.removesuffix("-no-collisions"), ("–",) * 3)
            ours = [text_of(means, key) for key in ("chamfer", "surface_squared", "penetration")]
            rows.append([name, *[f"{own} ({theirs})" for own, theirs in zip(ours, paper, strict=True)]])
    return table(["model", "Chamfer (paper)", "Chamfer Surface (paper)", "inside (paper)"], rows)


def complex_scenes(reports: dict[str, dict[str, Any]]) -> str:
    """Table 1."""
    rows = []
    for (scene, solid), paper in PAPER_SCENES.items():
        for name, report in reports.items():
            found = [one for one in report["scenes"] if (one["data"], one["scene"]) == ("complex-scenes", scene)]
            if found:
                keys = ("chamfer", "surface_squared", "penetration", "depth")
                ours = " / ".join(text_of(window_of(found[0]), key) for key in keys)
                rows.append([solid, name, ours, paper.get(name.removesuffix("-no-collisions"), "–")])
    return table(["scene", "model", "Chamfer / Surface / inside / mean inside, m", "the paper's"], rows)


def training_curve(runs: list[Path], name: str) -> tuple[list[float], list[float], list[float]]:
    """Thousands of steps, minutes of training, and Chamfer, over all the runs of a preset."""
    steps, minutes, chamfer = [], [], []
    steps_before = minutes_before = 0.0
    for log in (run / name / "log.csv" for run in runs):
        if not log.is_file():
            break
        with log.open(newline="") as file:
            rows = list(csv.DictReader(file))
        validated = [row for row in rows if row["chamfer"] != "nan"]
        steps += [steps_before + float(row["step"]) / 1000 for row in validated]
        minutes += [minutes_before + float(row["seconds"]) / 60 for row in validated]
        chamfer += [float(row["chamfer"]) for row in validated]
        steps_before += float(rows[-1]["step"]) / 1000
        minutes_before += float(rows[-1]["seconds"]) / 60
    return steps, minutes, chamfer


def draw(runs: list[Path], path: Path) -> None:
    """Chamfer over steps, and over minutes of training."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(ncols=2, sharey=True, figsize=(10, 4), constrained_layout=True)
    for name in PRESETS:
        steps, minutes, chamfer = training_curve(runs, name)
        if steps:
            left.plot(steps, chamfer, marker="o", markersize=4, label=name)
            right.plot(minutes, chamfer, marker="o", markersize=4)
    left.set(xlabel="thousand steps", ylabel="Chamfer on validation scenes, m", yscale="log")
    right.set(xlabel="minutes of one core, rollouts included")
    for axes in (left, right):
        axes.grid(alpha=0.3)
    figure.legend(*left.get_legend_handles_labels(), loc="outside right upper")
    figure.savefig(path, dpi=120)


def main() -> None:
    """Print the tables, draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reports", type=Path)
    parser.add_argument("--runs", type=Path, nargs="+", default=[])
    parser.add_argument("--figure", type=Path, default=Path("docs/images/side-by-side.png"))
    arguments = parser.parse_args()
    names = [name + end for name in PRESETS for end in ("", "-no-collisions")]
    reports = {name: report for name in names if (report := read(arguments.reports / name)) is not None}
    print(data_sets(reports))
    print(ablation(reports, "prim-shapes-test"))
    print(complex_scenes(reports))
    if arguments.runs:
        draw(arguments.runs, arguments.figure)


if __name__ == "__main__":
    main()
