import subprocess
import sys

import pytest

# oneDNN's cache lives as long as the process, so this test needs its own.
MANY_SIZES = """
import resource, sys, torch
from surfsup.learned.message_passing.linear import linear, weight_gradient
weight = torch.randn(64, 64).to(getattr(torch, sys.argv[1]))
def megabytes_after_sizes(first, last):
    for size in range(first, last):
        rows = torch.ones(size, 64, dtype=weight.dtype)
        weight_gradient(linear(rows, weight), rows)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
before = megabytes_after_sizes(1000, 1030)
print(megabytes_after_sizes(1030, 1530) - before)
"""


@pytest.mark.parametrize("precision", ["float32", "bfloat16"])
def test_products_of_many_sizes_do_not_fill_the_memory(precision):
    done = subprocess.run(
        [sys.executable, "-c", MANY_SIZES, precision], capture_output=True, text=True, check=True, timeout=120
    )
    assert float(done.stdout) < 100, "megabytes for 500 more sizes"
