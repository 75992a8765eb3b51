"""Training windows of simulations that arrive while training runs."""

from __future__ import annotations

from collections import deque
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import torch

from surfsup.datasets.streaming.stream import SimulatedScene, SimulationStream, open_stream
from surfsup.datasets.windows import Window, sample_window
from surfsup.errors import InputError
from surfsup.sph.environment import Environment

BUFFER_SIZE = 32  # simulations: 1.6 GB at 2,600 particles and 800 frames


class StreamedWindows:
    """Random windows of the last simulations of a stream.

    A buffer holds the last simulations; when it is full, each new one replaces the oldest. Its contents depend on the
    speed of the workers, so the same seed does not give the same windows.

    Attributes:
        fingerprint: None, since the data changes.
    """

    fingerprint = None

    def __init__(self, stream: SimulationStream, size: int = BUFFER_SIZE, device: torch.device | str = "cpu") -> None:
        """Wait for the first simulation of ``stream``; keep the last ``size``, with windows on ``device``.

        Raises:
            SimulationError: no valid scene was found for an index, or the scheduler was lost.
        """
        self._stream, self._device = stream, device
        self._buffer: deque[tuple[SimulatedScene, Environment]] = deque(maxlen=size)
        self._add(next(stream))

    def _add(self, simulated: SimulatedScene) -> None:
        if simulated.scene.moves:
            raise InputError("the recipe has solids that move, which no learned simulator knows; choose another")
        if simulated.scene.is_open:
            raise InputError("the recipe has taps or drains, which no learned simulator knows; choose another")
        environment = Environment.of(simulated.scene, simulated.scene.build_surface(), self._device)
        self._buffer.append((simulated, environment))

    def __len__(self) -> int:
        """Number of simulations in the buffer."""
        return len(self._buffer)

    def sample(
        self, random: np.random.Generator, history_length: int, frames: int, scene_starts: float = 0.0
    ) -> Window:
        """As :meth:`surfsup.datasets.windows.WindowSource.sample`; first add finished simulations to the buffer.

        Raises:
            InputError: the scene is too short for the window.
            SimulationError: no valid scene was found for an index, or the scheduler was lost.
        """
        for simulated in self._stream.finished():
            self._add(simulated)
        simulated, environment = self._buffer[int(random.integers(len(self)))]
        name = f"scene {simulated.index} of the stream"
        return sample_window(
            simulated, simulated.scene, name, environment, random, history_length, frames, scene_starts
        )


def stream_for_training(
    recipe: str, run: Path, entropy: list[int], workers: int | None = None, scheduler: str | None = None
) -> AbstractContextManager[SimulationStream]:
    """The stream of scenes for the training run in the folder ``run``.

    Args:
        recipe: name of the recipe.
        run: folder of the run; its subfolder ``stream`` holds the recipe's surface files.
        entropy: seed and step of the run, so that a resumed run gets other scenes. A hash of them is the stream's seed,
            which differs from the small seeds of data sets.
        workers: simulations side by side on this machine; 2 by default.
        scheduler: address of a dask scheduler to use instead.
    """
    seed = int(np.random.SeedSequence(entropy).generate_state(1)[0])
    return open_stream(recipe, run / "stream", seed, workers=workers, scheduler=scheduler)
