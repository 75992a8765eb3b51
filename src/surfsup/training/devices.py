"""The device of training: the CPU, a GPU, or several processes started by torchrun."""

from __future__ import annotations

import os
from datetime import timedelta
from importlib.util import find_spec
from typing import TYPE_CHECKING

from surfsup.errors import InputError

if TYPE_CHECKING:
    from lightning_fabric import Fabric

VALIDATION_TIMEOUT = timedelta(hours=6)  # the other processes wait while the main one validates
REQUIRED = {"lightning-fabric": "lightning_fabric", "tensorboard": "tensorboard"}  # module of each package


def fabric_on(device: str = "cpu") -> Fabric:
    """Create a Fabric for ``device``, 'cpu' or 'cuda'; under torchrun it synchronizes the processes.

    Raises:
        InputError: Lightning Fabric or TensorBoard is not installed.
    """
    require_packages()
    from lightning_fabric import Fabric
    from lightning_fabric.plugins.environments import TorchElasticEnvironment
    from lightning_fabric.strategies import DDPStrategy

    kind, _, number = device.partition(":")
    accelerator = "gpu" if kind == "cuda" else kind
    if not TorchElasticEnvironment.detect():
        return Fabric(accelerator=accelerator, devices=[int(number)] if number else 1)
    local, total = int(os.environ["LOCAL_WORLD_SIZE"]), int(os.environ["WORLD_SIZE"])
    fabric = Fabric(
        accelerator=accelerator,
        devices=local,
        num_nodes=total // local,
        strategy=DDPStrategy(timeout=VALIDATION_TIMEOUT),
    )
    fabric.launch()
    return fabric


def shut_down(fabric: Fabric) -> None:
    """Close the connection between the processes of torchrun, if there are several, once all have arrived here.

    A process that exits while another still receives data may abort it.
    """
    from torch import distributed

    if fabric.world_size > 1 and distributed.is_initialized():
        fabric.barrier()
        distributed.destroy_process_group()


def require_packages() -> None:
    """Check that the packages that only training needs are installed.

    Raises:
        InputError: one is missing; the message says how to install it.
    """
    missing = [name for name, module in REQUIRED.items() if find_spec(module) is None]
    if missing:
        raise InputError(f"training needs {' and '.join(missing)}: pip install 'surfsup[train]'")
