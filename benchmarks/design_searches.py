"""Nine parameters by gradient, beside CMA-ES and random search with as many simulations: the balls of
`examples/deflectors.py`.

    python benchmarks/design_searches.py [-o out/deflectors] [--iterations 60]

Resumes the design in that folder, for instance that of the example, and writes ``baselines.json`` and
``baselines.png`` there. `surfsup design ... --baselines` does the same for the designs of the paper.
"""

from __future__ import annotations

import argparse
import runpy
from pathlib import Path

from surfsup.design import optimize
from surfsup.design.baselines import compare_with_baselines

EXAMPLE = Path(__file__).parent.parent / "examples" / "deflectors.py"


def main() -> None:
    """Finish the design if necessary, then search."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--out", type=Path, default=Path("out/deflectors"))
    parser.add_argument("--iterations", type=int, default=60)
    arguments = parser.parse_args()
    task = runpy.run_path(str(EXAMPLE))["task"]
    run = optimize(task, arguments.out, arguments.iterations, resume=True)
    print(compare_with_baselines(run, with_reference=False))


if __name__ == "__main__":
    main()
