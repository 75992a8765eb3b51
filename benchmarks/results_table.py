"""The tables of docs/results.md on the default model, as Markdown, from the reports of `surfsup evaluate`.

    python benchmarks/results_table.py report-prim report-others report-complex report-wide

One row for every kind of solid and every data set, model / floor, a dash where no scene has one; then Chamfer over
time, in frames 100 and 200, and the share of particles that the guard moved.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

PLACES = {"chamfer": 4, "chamfer_squared": 5, "surface": 1, "surface_squared": 2, "height": 4}
TITLES = "data set | scenes | Chamfer, m | ratio | squared, m² | Surface, m | Surface squared, m² | inside | lost"
TITLES += " | height error, m | energy ratio | density"
WINDOWS = ("0-100", "100-200", "200-300", "300-end", "first 300")
FRAMES = (100, 200)

Entry = dict[str, Any]


def number(value: float | None, places: int) -> str:
    """A value with so many places, a dash where there is none."""
    return "–" if value is None else f"{value:.{places}f}"


def row_of(mean: Entry) -> str:
    """One line of the first table."""
    told = mean["windows"]["all"]
    whole = mean["surface"] == "all"
    name = f"**{mean['data']}**" if whole else f"{mean['data']}: {mean['surface']}"
    both = {key: " / ".join(number(told[key][of], n) for of in ("model", "floor")) for key, n in PLACES.items()}
    cells = [name, str(mean["scenes"]), both["chamfer"], number(told["chamfer"]["ratio"], 2), both["chamfer_squared"]]
    cells += [both["surface"], both["surface_squared"]]
    cells += [number(told[key]["model"], 0) for key in ("penetration", "lost")]
    cells += [both["height"], *(number(told[key]["model"], 2) for key in ("energy", "density"))]
    return "| " + " | ".join(cells) + " |"


def in_frame(scenes: list[Entry], frame: int) -> str:
    """The ratio of a single frame, means over the scenes that have a floor."""
    curves = [curve for scene in scenes if (curve := scene["curves"]["chamfer"])["floor"]]
    if not curves:
        return number(None, 2)
    model, floor = (np.mean([curve[of][frame] for curve in curves]) for of in ("model", "floor"))
    return f"{model / floor:.2f}"


def course_of(mean: Entry, scenes: list[Entry]) -> str:
    """One line of the second table."""
    cells = [mean["data"]]
    for window in WINDOWS:
        told = mean["windows"][window]["chamfer"]
        cells.append(f"{number(told['model'], 4)} / {number(told['floor'], 4)} ({number(told['ratio'], 2)})")
    cells += [in_frame(scenes, frame) for frame in FRAMES]
    cells.append(f"{100 * np.mean([scene['handle_collisions'] for scene in scenes]):.3f} %")
    return "| " + " | ".join(cells) + " |"


def lines(reports: list[Entry]) -> Iterator[str]:
    """Both tables."""
    yield f"| {TITLES} |"
    yield "|---" * 12 + "|"
    for report in reports:
        yield from (row_of(mean) for mean in report["means"])
    yield ""
    yield (
        f"| data set | {' | '.join(WINDOWS)} | "
        + " | ".join(f"frame {frame}" for frame in FRAMES)
        + " | handle_collisions |"
    )
    yield "|---" * 9 + "|"
    for report in reports:
        for mean in report["means"]:
            if mean["surface"] == "all":
                yield course_of(mean, [scene for scene in report["scenes"] if scene["data"] == mean["data"]])


def main() -> None:
    """Print both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reports", type=Path, nargs="+")
    arguments = parser.parse_args()
    print("\n".join(lines([json.loads((folder / "report.json").read_text()) for folder in arguments.reports])))


if __name__ == "__main__":
    main()
