"""The benchmark tables of README.md and docs/benchmarks.md, generated from `benchmarks/results/*.json`.

    python docs/benchmark_table.py            # write both tables between their markers
    python docs/benchmark_table.py --check    # exit status 1 if a table differs from the files

MkDocs runs it as a hook, so the site always shows the files' numbers.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "benchmarks"))
from record import Figure, Result, read_result  # noqa: E402

ROWS = (
    "accuracy_primitives",
    "accuracy_meshes",
    "accuracy_pouring",
    "accuracy_tilting",
    "accuracy_fine",
    "accuracy_stirring",
    "accuracy_taps",
    "accuracy_honey",
    "accuracy_networks",
    "speed_3000",
    "speed_50000",
    "speed_networks",
    "growth",
    "jug",
    "at_rest",
    "physics_archimedes",
    "physics_floor",
    "physics_draught",
    "physics_vessels",
    "physics_outflow",
    "physics_bucket",
    "physics_duct",
    "physics_drop",
    "honey_speed",
    "oil_and_water",
    "start_up",
    "design_bowl",
    "live",
    "thin_cup",
    "dam_break",
    "stability",
)
README_ROWS = ("accuracy_primitives", "accuracy_networks", "speed_3000", "speed_50000", "at_rest")
BEGIN, END = "<!-- benchmark table: written by docs/benchmark_table.py -->", "<!-- end of the benchmark table -->"
BENCHMARKS_PAGE, README = ROOT / "docs" / "benchmarks.md", ROOT / "README.md"


def figure_text(figure: Figure | None, unit: str) -> str:
    """A figure with its unit; a dash if there is none."""
    if figure is None:
        return "–"
    number = f"{figure:.4g}" if isinstance(figure, float | int) else figure
    return f"{number} {unit}".strip()


def row(result: Result, with_provenance: bool) -> str:
    """One line of a table."""
    peer = f"{figure_text(result.peer_figure, result.unit)} ({result.peer})" if result.peer else "–"
    cells = [result.claim, f"**{figure_text(result.figure, result.unit)}**", peer, f"`{result.command}`"]
    if with_provenance:
        machine = result.machine
        measured = [result.date, result.commit or "commit not recorded", f"{machine['cpu']}, {machine['isa']}"]
        if threads := machine["threads"]:
            measured.append("1 thread" if threads == 1 else f"{threads} threads")
        cells.append("; ".join(measured) + ("" if result.source == "measured" else f" ({result.source})"))
    return "| " + " | ".join(cells) + " |"


def table(names: tuple[str, ...], with_provenance: bool) -> str:
    """A Markdown table of the named results."""
    header = ["claim", "figure", "peer's figure", "command"] + (["measured"] if with_provenance else [])
    lines = ["| " + " | ".join(header) + " |", "|---" * len(header) + "|"]
    return "\n".join([*lines, *(row(read_result(name), with_provenance) for name in names)])


def with_table(text: str, names: tuple[str, ...], with_provenance: bool) -> str:
    """The page with the table between its markers replaced.

    Raises:
        ValueError: the page has no markers.
    """
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"no markers '{BEGIN}' and '{END}'")
    return f"{before}{BEGIN}\n\n{table(names, with_provenance)}\n\n{END}{after}"


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """MkDocs hook: fill the table of the benchmark page."""
    return with_table(markdown, ROWS, True) if page.file.src_uri == BENCHMARKS_PAGE.name else markdown


def main(check: bool) -> int:
    """Write or check both pages; the exit status."""
    status = 0
    for path, names, with_provenance in ((BENCHMARKS_PAGE, ROWS, True), (README, README_ROWS, False)):
        old = path.read_text(encoding="utf-8")
        new = with_table(old, names, with_provenance)
        if new != old and check:
            print(f"{path.relative_to(ROOT)}: the benchmark table differs; run python docs/benchmark_table.py")
            status = 1
        elif new != old:
            path.write_text(new, encoding="utf-8")
    return status


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))
