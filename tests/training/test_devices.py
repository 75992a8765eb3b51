import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from safetensors.torch import load_file

from surfsup.datasets.windows import Windows
from surfsup.errors import InputError
from surfsup.training import devices
from surfsup.training.devices import fabric_on
from surfsup.training.run import TrainingRun
from surfsup.training.train import train
from tests.training.conftest import config, message_passing

ROOT = Path(__file__).parents[2]


def test_two_processes_train_like_one_with_the_whole_batch(tmp_path, data):
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    script = ["-m", "tests.training.two_processes", str(data), str(tmp_path)]
    variables = {**os.environ, "OMP_NUM_THREADS": "1"}
    ended = subprocess.run([*torchrun, *script], cwd=ROOT, env=variables, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stderr[-8000:]
    for name, options in (("corrected", config()), ("surfsup", message_passing("surfsup"))):
        alone, losses = TrainingRun(options, tmp_path / "alone" / name), []
        train(alone, Windows(data), data, report=lambda now, to=losses: to.append(now.loss))
        assert json.loads((tmp_path / f"{name}.json").read_text()) == pytest.approx(losses, rel=1e-4)
        together = load_file(tmp_path / name / "checkpoint.safetensors")
        for key, value in load_file(alone.files.last).items():
            if not key.startswith("rollout."):  # unfinished rollouts; the main process has only its own
                assert together[key].numpy() == pytest.approx(value.numpy(), abs=2e-4), key


def test_a_batch_must_be_split_evenly_over_the_processes(tmp_path):
    class Three:
        world_size = 3

    with pytest.raises(InputError, match="a batch of 2 cannot be split evenly over 3 processes; give batch=3"):
        TrainingRun(config(), tmp_path, Three())


def test_a_missing_package_is_named_with_the_command_that_installs_it(monkeypatch):
    monkeypatch.setitem(devices.REQUIRED, "a-package", "a_module_that_is_not_there")
    with pytest.raises(InputError, match=r"training needs a-package: pip install 'surfsup\[train\]'"):
        fabric_on("cpu")
