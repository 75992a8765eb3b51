"""Where training computes: the CPU, a GPU, or several processes that torchrun started."""

from __future__ import annotations

import os
from datetime import timedelta
from importlib.util import find_spec
from typing import TYPE_CHECKING

from surfsup.errors import InputError

if TYPE_CHECKING:
    from lightning_fabric import Fabric

LONGEST_WAIT = timedelta(hours=6)  # of the other processes while the first judges a model


def fabric_on(device: str = "cpu") -> Fabric:
    """What moves a model to ``device``, 'cpu' or 'cuda', and keeps the processes of torchrun in step, if it runs.

    Raises:
        InputError: Lightning Fabric or TensorBoard is not installed.
    """
    require_installed()
    from lightning_fabric import Fabric
    from lightning_fabric.plugins.environments import TorchElasticEnvironment
    from lightning_fabric.strategies import DDPStrategy

    kind, _, number = device.partition(":")
    accelerator = "gpu" if kind == "cuda" else kind
    if not TorchElasticEnvironment.detect():
        return Fabric(accelerator=accelerator, devices=[int(number)] if number else 1)
    here, everywhere = int(os.environ["LOCAL_WORLD_SIZE"]), int(os.environ["WORLD_SIZE"])
    fabric = Fabric(
        accelerator=accelerator,
        devices=here,
        num_nodes=everywhere // here,
        strategy=DDPStrategy(timeout=LONGEST_WAIT),
    )
    fabric.launch()
    return fabric


def leave_together(fabric: Fabric) -> None:
    """End the conversation of torchrun's processes, if there are several, once all of them have come here.

    One that leaves while another is still being told something may abort it at its exit.
    """
    from torch import distributed

    if fabric.world_size > 1 and distributed.is_initialized():
        fabric.barrier()
        distributed.destroy_process_group()


def require_installed() -> None:
    """Make sure that what only training needs is there.

    Raises:
        InputError: it is not; says how to install it.
    """
    missing = [name for name, module in NEEDED.items() if find_spec(module) is None]
    if missing:
        raise InputError(f"training needs {' and '.join(missing)}: pip install 'surfsup[train]'")


NEEDED = {"lightning-fabric": "lightning_fabric", "tensorboard": "tensorboard"}
