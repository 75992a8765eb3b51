"""What all peers share: the best times of two jobs, as a line of JSON. It needs nothing but Python."""

import json
import sys
import time
from collections.abc import Callable


def report(forward: Callable[[], object], both: Callable[[], object], versions: str) -> None:
    """Print the best milliseconds of ``forward`` and ``both``, each of which waits for its result."""
    repeats = int(sys.argv[2])
    found = {"versions": versions}
    for name, job in (("forward", forward), ("both", both)):
        job()
        job()  # compiled and warm
        spent = []
        for _ in range(repeats):
            cpu, wall = time.process_time(), time.perf_counter()
            job()
            spent.append((time.process_time() - cpu, time.perf_counter() - wall))
        found[f"{name}_cpu"], found[f"{name}_wall"] = (1e3 * min(column) for column in zip(*spent, strict=True))
    print(json.dumps(found))
