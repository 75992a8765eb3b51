"""Trains a tiny model and writes its losses and last weights; torchrun starts it once for each process."""

import json
import sys
from pathlib import Path

import torch

from surfsup.datasets.windows import Windows
from surfsup.training.devices import fabric_on, shut_down
from surfsup.training.run import TrainingRun
from surfsup.training.train import train
from tests.training.conftest import config, message_passing

if __name__ == "__main__":
    torch.set_num_threads(1)
    data, out = Path(sys.argv[1]), Path(sys.argv[2])
    fabric = fabric_on("cpu")
    for name, options in (("corrected", config()), ("surfsup", message_passing("surfsup"))):
        losses: list[float] = []
        run = TrainingRun(options, out / name, fabric)
        train(run, Windows(data), data, report=lambda now, to=losses: to.append(now.loss))
        if fabric.is_global_zero:
            (out / f"{name}.json").write_text(json.dumps(losses))
    shut_down(fabric)
