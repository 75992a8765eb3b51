"""The table of a sweep: a row for each case, as CSV, and as Parquet where pyarrow is installed."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from surfsup.io.atomic_file import atomic_file
from surfsup.sweep.case import Case
from surfsup.sweep.simulate_case import RESULT

Row = Mapping[str, Any]


def rows_of(folder: Path, cases: Sequence[Case], errors: Mapping[str, str]) -> list[Row]:
    """The rows of the cases in order; a case that failed has its message in the column ``error``."""
    rows = []
    for case in cases:
        result = folder / case.name / RESULT
        if result.exists():
            rows.append(json.loads(result.read_text()))
        elif case.name in errors:
            rows.append({"case": case.name, "scene": case.scene_name, **case.values, "error": errors[case.name]})
    return rows


def write_table(folder: Path, rows: Sequence[Row]) -> list[Path]:
    """Write ``table.csv``, and ``table.parquet`` where pyarrow is installed; returns the files."""
    columns = list(dict.fromkeys(column for row in rows for column in row))
    table = folder / "table.csv"
    with atomic_file(table) as partial, partial.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows(rows)
    try:
        from pyarrow import Table, parquet
    except ModuleNotFoundError:
        return [table]
    second = folder / "table.parquet"
    with atomic_file(second) as partial:
        parquet.write_table(
            Table.from_pydict({column: [row.get(column) for row in rows] for column in columns}), partial
        )
    return [table, second]
