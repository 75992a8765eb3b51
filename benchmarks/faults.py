"""The fault campaign: damaged files, kills, full disks, missing libraries and more, each run of `surfsup` evaluated.

    python benchmarks/faults.py [--short] [--only mesh scene ...] [--seed 0] [--json out/faults.json]

A run is right if it succeeds with a right result, or refuses in one line with exit status 2. A traceback, a signal, a
hang of over 60 s, a silently wrong result, a lost or half-written file, and a file outside the folders that were named
are faults of surfsup; the exit status is then 1. Every run is a child of this process, which has loaded the libraries
before, so a run of a second takes a second. The same seed gives the same damage.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from fault_campaign.campaign import KINDS, Choice
from fault_campaign.inputs import make_inputs
from fault_campaign.preload import MODULES, SHORT_MODULES, preload
from fault_campaign.verdict import BAD


def main() -> int:
    """Run the campaign and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true", help="a few of each kind, in some seconds")
    parser.add_argument("--only", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--names", default="", help="a regular expression, of the cases to repeat")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--json", type=Path, help="where the results go, one by one; those there already are not repeated"
    )
    parser.add_argument("--keep", action="store_true", help="keep the folders of faults")
    arguments = parser.parse_args()
    began = time.monotonic()
    work = Path(tempfile.mkdtemp(prefix="faults-"))
    os.environ["SURFSUP_CACHE"] = str(work / "cache")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # with the results so far
    preload(SHORT_MODULES if arguments.short else MODULES)
    rows = read(arguments.json, arguments.seed)
    try:
        inputs = make_inputs(work / "inputs", light=arguments.short)
        for kind in arguments.only:
            random = np.random.default_rng([arguments.seed, list(KINDS).index(kind)])
            count = KINDS[kind].short if arguments.short else KINDS[kind].count
            done = {row["number"] for row in rows if row["of"] == kind}
            choice = Choice(arguments.names, done, arguments.keep)
            for row in KINDS[kind].rows(random, count, inputs, work / kind, choice):
                rows.append({"of": kind, **row})
                write(arguments.json, arguments.seed, rows)
                if row["outcome"] in BAD:
                    print(f"{row['outcome']}: {kind}: {row['name']}: {row['reason']}", flush=True)
    except KeyboardInterrupt:
        print("interrupted; the results so far:")
    finally:
        if not arguments.keep:
            shutil.rmtree(work, ignore_errors=True)
    print(table(rows))
    print(f"{len(rows)} runs in {time.monotonic() - began:.0f} s, seed {arguments.seed}")
    return int(any(row["outcome"] in BAD for row in rows))


def read(path: Path | None, seed: int) -> list[dict[str, object]]:
    """The results of earlier legs with the same seed."""
    if path is None or not path.exists():
        return []
    content = json.loads(path.read_text())
    return content["rows"] if content["seed"] == seed else []


def write(path: Path | None, seed: int, rows: list[dict[str, object]]) -> None:
    """All results so far."""
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps({"seed": seed, "rows": rows}, indent=1) + "\n")
    partial.replace(path)


def table(rows: list[dict[str, object]]) -> str:
    """Outcomes by kind, as Markdown."""
    kinds = list(dict.fromkeys(row["kind"] for row in rows))
    counts = Counter((row["kind"], row["outcome"]) for row in rows)
    outcomes = sorted({outcome for _, outcome in counts}, key=lambda name: (name in BAD, str(name)))
    lines = [f"| kind | runs | {' | '.join(map(str, outcomes))} |", "|---" * (len(outcomes) + 2) + "|"]
    for kind in kinds:
        total = sum(row["kind"] == kind for row in rows)
        numbers = " | ".join(str(counts[kind, outcome]) for outcome in outcomes)
        lines.append(f"| {kind} | {total} | {numbers} |")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
