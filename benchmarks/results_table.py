"""The accuracy tables of docs/benchmarks.md, as Markdown, from the reports of `surfsup evaluate`.

    python benchmarks/results_table.py REPORT ...

The first table has a row for every kind of solid and every data set, with the simulator beside the floor and a dash if
no scene has a floor. The second has the Chamfer distance over time, in frames 100 and 200, and the share of particles
that collision handling moved.

For the default simulator each data set is also written to `benchmarks/results/accuracy_*.json`.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from record import write_result
from surfsup.learned.simulator_names import DEFAULT_SIMULATOR

PLACES = {"chamfer": 4, "chamfer_squared": 5, "surface": 1, "surface_squared": 2, "height": 4}
TITLES = "data set | scenes | Chamfer, m | ratio | squared, m² | Surface, m | Surface squared, m² | inside | lost"
TITLES += " | height error, m | energy ratio | density"
WINDOWS = ("0-100", "100-200", "200-300", "300-end", "first 300")
FRAMES = (100, 200)
RESULTS = {  # data set: name of the result, and what its scenes are
    "prim-shapes-test": ("accuracy_primitives", "primitives"),
    "prim-unions": ("accuracy_unions", "unions of two primitives"),
    "funnels": ("accuracy_funnels", "funnels"),
    "bowls": ("accuracy_bowls", "bowls"),
    "chairs": ("accuracy_chairs", "chairs"),
    "complex-scenes": ("accuracy_meshes", "a large mesh and a furnished room"),
    "mountain": ("accuracy_mountain", "a mountain"),
    "assorted": ("accuracy_assorted", "assorted scenes (400 frames)"),
    "pouring": ("accuracy_pouring", "cups that pour, 300 frames"),
    "tilting": ("accuracy_tilting", "containers that are tilted and shaken, 300 frames"),
    "fine": ("accuracy_fine", "small things, particles of 3 mm, 300 frames"),
    "stirring": ("accuracy_stirring", "paddles that turn, 300 frames"),
    "taps": ("accuracy_taps", "taps, jets and fountains, 300 frames"),
    "honey": ("accuracy_honey", "viscous liquids on primitives, 300 frames"),
    "tanks": ("accuracy_tanks", "tanks and dam breaks (400 frames)"),
}

Entry = dict[str, Any]


def number(value: float | None, places: int) -> str:
    """A value with ``places`` decimal places, or a dash."""
    return "–" if value is None else f"{value:.{places}f}"


def row_of(mean: Entry) -> str:
    """One line of the first table."""
    scores = mean["windows"]["all"]
    name = f"**{mean['data']}**" if mean["surface"] == "all" else f"{mean['data']}: {mean['surface']}"
    both = {key: " / ".join(number(scores[key][of], n) for of in ("prediction", "floor")) for key, n in PLACES.items()}
    cells = [name, str(mean["scenes"]), both["chamfer"], number(scores["chamfer"]["ratio"], 2), both["chamfer_squared"]]
    cells += [both["surface"], both["surface_squared"]]
    cells += [number(scores[key]["prediction"], 0) for key in ("penetration", "lost")]
    cells += [both["height"], *(number(scores[key]["prediction"], 2) for key in ("energy", "density"))]
    return "| " + " | ".join(cells) + " |"


def ratio_in_frame(scenes: list[Entry], frame: int) -> float | None:
    """The ratio in a single frame, of means over the scenes that have a floor."""
    curves = [curve for scene in scenes if (curve := scene["curves"]["chamfer"])["floor"]]
    if not curves:
        return None
    model, floor = (float(np.mean([curve[of][frame] for curve in curves])) for of in ("prediction", "floor"))
    return model / floor


def time_row_of(mean: Entry, scenes: list[Entry]) -> str:
    """One line of the second table."""
    cells = [mean["data"]]
    for window in WINDOWS:
        if window not in mean["windows"]:  # the scenes are shorter
            cells.append("–")
            continue
        scores = mean["windows"][window]["chamfer"]
        cells.append(f"{number(scores['prediction'], 4)} / {number(scores['floor'], 4)} ({number(scores['ratio'], 2)})")
    cells += [number(ratio_in_frame(scenes, frame), 2) for frame in FRAMES]
    cells.append(f"{100 * np.mean([scene['collided_share'] for scene in scenes]):.3f} %")
    return "| " + " | ".join(cells) + " |"


def scenes_of(report: Entry, mean: Entry) -> list[Entry]:
    """The scenes of a data set."""
    return [scene for scene in report["scenes"] if scene["data"] == mean["data"]]


def totals(reports: list[Entry]) -> Iterator[tuple[Entry, list[Entry]]]:
    """The means over all scenes of every data set, and these scenes."""
    for report in reports:
        yield from ((mean, scenes_of(report, mean)) for mean in report["means"] if mean["surface"] == "all")


def lines(reports: list[Entry]) -> Iterator[str]:
    """Both tables."""
    yield f"| {TITLES} |"
    yield "|---" * 12 + "|"
    for report in reports:
        yield from (row_of(mean) for mean in report["means"])
    yield ""
    frames = " | ".join(f"frame {frame}" for frame in FRAMES)
    yield f"| data set | {' | '.join(WINDOWS)} | {frames} | collided |"
    yield "|---" * 9 + "|"
    yield from (time_row_of(mean, scenes) for mean, scenes in totals(reports))


def write_results(reports: list[Entry]) -> None:
    """Write one result for each known data set."""
    for mean, scenes in totals([report for report in reports if report["simulator"]["name"] == DEFAULT_SIMULATOR]):
        if mean["data"] not in RESULTS:
            continue
        name, what = RESULTS[mean["data"]]
        scores = mean["windows"]["all"]
        count = mean["scenes"]
        write_result(
            name,
            f"Chamfer distance to the reference, mean over {count} unseen {'scene' if count == 1 else 'scenes'}: {what}"
            + ("" if " frames" in what else ", 800 frames"),
            round(scores["chamfer"]["prediction"], 4),
            "m",
            "floor: SPlisHSPlasH from a start 1 mm aside",
            round(scores["chamfer"]["floor"], 4),
            f"surfsup evaluate dfsph data/{mean['data']}",
            values={
                "data_set": mean["data"],
                "scenes": count,
                "ratio": scores["chamfer"]["ratio"],
                "height_error_m": scores["height"]["prediction"],
                "energy_ratio": scores["energy"]["prediction"],
                "density_ratio": scores["density"]["prediction"],
                "particles_inside": scores["penetration"]["prediction"],
                "particles_lost": scores["lost"]["prediction"],
                **{f"ratio_frame_{frame}": ratio_in_frame(scenes, frame) for frame in FRAMES},
            },
        )


def main() -> None:
    """Print both tables, write the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("reports", type=Path, nargs="+")
    arguments = parser.parse_args()
    reports = [json.loads((folder / "report.json").read_text()) for folder in arguments.reports]
    print("\n".join(lines(reports)))
    write_results(reports)


if __name__ == "__main__":
    main()
