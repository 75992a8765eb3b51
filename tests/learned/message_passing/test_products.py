import subprocess
import sys

import pytest

# What oneDNN keeps it keeps until the process ends, so this needs one of its own.
MANY_SIZES = """
import resource, sys, torch
from surfsup.learned.message_passing.products import times, weight_gradient
weight = torch.randn(64, 64).to(getattr(torch, sys.argv[1]))
def of_sizes(first, last):
    for size in range(first, last):
        rows = torch.ones(size, 64, dtype=weight.dtype)
        weight_gradient(times(rows, weight), rows)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
before = of_sizes(1000, 1030)
print(of_sizes(1030, 1530) - before)
"""


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_products_of_ever_other_sizes_do_not_fill_the_memory(precision):
    done = subprocess.run(
        [sys.executable, "-c", MANY_SIZES, precision], capture_output=True, text=True, check=True, timeout=120
    )
    assert float(done.stdout) < 100, "megabytes more for 500 sizes more"
