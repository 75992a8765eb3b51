"""Imports what the verbs import, before the campaign begins, so that each child finds it loaded.

Nothing here may start a thread: a child has the thread that forked it alone.
"""

from __future__ import annotations

import importlib
import threading

MODULES = (
    "av",
    "h5py",
    "igl",
    "lightning_fabric",
    "mesh_suites",
    "pyvista",
    "scipy.spatial",
    "torch._dynamo",
    "torch.utils.tensorboard",
    "trimesh",
    "surfsup.cli.program",
    "surfsup.continuation",
    "surfsup.datasets.generation.generate",
    "surfsup.datasets.streaming.streamed_windows",
    "surfsup.design.run",
    "surfsup.design.verification",
    "surfsup.evaluation.pair",
    "surfsup.exporting.export",
    "surfsup.exporting.usd",
    "surfsup.fitting.siren_fit",
    "surfsup.fitting.siren_result",
    "surfsup.io.output_folder",
    "surfsup.learned.loading",
    "surfsup.scene.from_surface",
    "surfsup.simulation",
    "surfsup.sweep.run",
    "surfsup.training.tensorboard",
    "surfsup.training.train",
    "surfsup.viewing.graphics",
    "surfsup.viewing.trajectory_pictures",
)

# Those of the short campaign, which needs neither training nor pictures.
SHORT_MODULES = (
    "h5py",
    "igl",
    "trimesh",
    "surfsup.cli.program",
    "surfsup.evaluation.pair",
    "surfsup.exporting.export",
    "surfsup.io.output_folder",
    "surfsup.learned.loading",
    "surfsup.scene.from_surface",
    "surfsup.simulation",
)


def preload(modules: tuple[str, ...] = MODULES) -> None:
    """Import them, as far as they are installed.

    Raises:
        RuntimeError: one of them has started a thread.
    """
    import torch

    torch.set_num_threads(1)
    for name in modules:
        try:
            importlib.import_module(name)
        except ImportError:
            if name.startswith("surfsup"):
                raise
    if threading.active_count() > 1:
        raise RuntimeError(f"threads run: {threading.enumerate()}")
