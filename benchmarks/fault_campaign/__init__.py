"""The parts of the fault campaign, `benchmarks/faults.py`: kinds of faults, what runs them, and what evaluates them."""
