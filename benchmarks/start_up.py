"""How long a user waits before anything happens: ``surfsup --help`` and the import of the package.

    python benchmarks/start_up.py

The first run of each reads the files from disk and is printed apart.
"""

from __future__ import annotations

import subprocess
import sys
import time

COMMANDS = {
    "surfsup --help": [sys.executable, "-m", "surfsup.cli", "--help"],
    "import surfsup": [sys.executable, "-c", "import surfsup"],
    "import the simulator": [
        sys.executable,
        "-c",
        "import surfsup.simulation, surfsup.scene, surfsup.io.trajectory",
    ],
}


def seconds(command: list[str]) -> float:
    """Wall time of one process."""
    began = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - began


def main() -> None:
    """Print the first and the best of five."""
    for name, command in COMMANDS.items():
        first, *rest = [seconds(command) for _ in range(6)]
        print(f"{name:<22} first {first:5.2f} s   best of 5 {min(rest):5.2f} s")


if __name__ == "__main__":
    main()
