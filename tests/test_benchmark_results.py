"""Published figures come from files that say how they were measured."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
sys.path[:0] = [str(ROOT / "benchmarks"), str(ROOT / "docs")]
import benchmark_table  # noqa: E402

import record  # noqa: E402

RESULTS = sorted(record.RESULTS.glob("*.json"))


@pytest.mark.parametrize("path", RESULTS, ids=lambda path: path.stem)
def test_a_result_names_command_date_and_machine(path: Path) -> None:
    result = record.read_result(path.stem)
    assert result.name == path.stem
    assert result.command.startswith(("python benchmarks/", "surfsup "))
    assert len(result.date) == len("2026-01-01")
    assert set(result.machine) >= {"cpu", "isa", "cores", "threads"}
    assert (result.peer is None) == (result.peer_figure is None)


def test_the_programs_of_the_commands_exist() -> None:
    commands = [record.read_result(path.stem).command.split() for path in RESULTS]
    programs = {words[1] for words in commands if words[0] == "python"}
    assert [program for program in programs if not (ROOT / program).is_file()] == []


def test_the_tables_of_the_pages_are_those_of_the_files(capsys: pytest.CaptureFixture[str]) -> None:
    assert benchmark_table.main(check=True) == 0, capsys.readouterr().out


def test_a_written_result_is_read_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record, "RESULTS", tmp_path)
    path = record.write_result("speed", "Time of a frame", 3.5, "ms", "peer", 7.0, "python benchmarks/x.py", threads=1)
    assert json.loads(path.read_text())["machine"]["threads"] == 1
    result = record.read_result("speed")
    assert (result.figure, result.peer_figure, result.source) == (3.5, 7.0, "measured")
    assert benchmark_table.row(result, with_provenance=False) == (
        "| Time of a frame | **3.5 ms** | 7 ms (peer) | `python benchmarks/x.py` |"
    )
