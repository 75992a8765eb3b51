"""Write the loss of a training run by step: python loss_csv.py runs/surfsup csv/surfsup.csv."""

import csv
import sys
from pathlib import Path

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

COLUMNS = {
    "loss": "loss",
    "error_near": "error/near the surface",
    "error_far": "error/far from the surface",
    "rate": "learning rate",
    "steps_a_second": "steps a second",
}

run, out = map(Path, sys.argv[1:])
events = EventAccumulator(str(run / "tensorboard"))
events.Reload()
values = {name: {event.step: event.value for event in events.Scalars(tag)} for name, tag in COLUMNS.items()}
with out.open("w", newline="") as file:
    writer = csv.writer(file)
    writer.writerow(["step", *COLUMNS])
    for step in sorted(values["loss"]):
        writer.writerow([step, *(f"{values[name].get(step, float('nan')):.6g}" for name in COLUMNS)])
