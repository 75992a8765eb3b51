"""A short part of the fault campaign, `benchmarks/faults.py`: damaged files and two runs in one folder."""

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent


def test_no_fault_ends_in_a_traceback_a_crash_or_a_wrong_result(tmp_path):
    command = [sys.executable, ROOT / "benchmarks/faults.py", "--short", "--json", tmp_path / "faults.json"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    rows = json.loads((tmp_path / "faults.json").read_text())["rows"]
    assert {row["kind"] for row in rows} == {"mesh", "scene", "trajectory", "kill", "surroundings"}
    assert len(rows) >= 20
