"""The parts of the fault campaign, `benchmarks/faults.py`: a file for each kind of fault, and what runs and judges them."""
