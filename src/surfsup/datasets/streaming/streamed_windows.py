"""Training windows of simulations that come in while training goes on."""

from __future__ import annotations

from collections import deque
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import torch

from surfsup.datasets.streaming.stream import Simulated, Stream, stream
from surfsup.datasets.windows import Window, draw_window
from surfsup.sph.state import Environment

POOL = 32  # simulations: 1.6 GB at 2,600 particles and 800 frames


class StreamedWindows:
    """Random windows of the last simulations of a stream.

    The pool grows to its size and then loses its oldest simulation to each new one. Which are there depends on how
    fast the workers are, so unlike with a folder the same seed does not give the same windows.
    """

    def __init__(self, stream: Stream, size: int = POOL, device: torch.device | str = "cpu") -> None:
        """Wait for the first simulation of ``stream``; keep the last ``size`` of them, windows lie on ``device``.

        Raises:
            SimulationError: no scene could be simulated, or the scheduler was lost.
        """
        self._stream, self._device = stream, device
        self._pool: deque[tuple[Simulated, Environment]] = deque(maxlen=size)
        self._add(next(stream))

    def _add(self, simulated: Simulated) -> None:
        environment = Environment.of(simulated.scene, simulated.scene.build_surface(), self._device)
        self._pool.append((simulated, environment))

    def __len__(self) -> int:
        """The number of simulations in the pool."""
        return len(self._pool)

    def draw(self, random: np.random.Generator, past: int, frames: int, starts: float = 0.0) -> Window:
        """A window of ``past`` frames, the present one and ``frames`` more, of a random scene, time and symmetry.

        Of all windows the share ``starts`` begins where its scene does. What has come in is taken into the pool before;
        this waits for nothing.

        Raises:
            InputError: the scene is too short for such a window.
            SimulationError: no scene could be simulated, or the scheduler was lost.
        """
        for simulated in self._stream.ready():
            self._add(simulated)
        simulated, environment = self._pool[int(random.integers(len(self)))]
        name = f"scene {simulated.index} of the stream"
        return draw_window(simulated, simulated.scene, name, environment, random, past, frames, starts)


def stream_for_training(
    recipe: str, run: Path, entropy: list[int], workers: int | None = None, scheduler: str | None = None
) -> AbstractContextManager[Stream]:
    """The stream of scenes for the training run in the folder ``run``.

    Args:
        recipe: which scenes.
        run: whose folder ``stream`` keeps the files of surfaces, where the recipe has some.
        entropy: seed and step of the run, so that a resumed one goes on with other scenes. They are hashed to a seed
            that no data set made with a small number has.
        workers: simulations side by side on this machine; 2 by default.
        scheduler: address of a dask scheduler whose workers do it instead.
    """
    seed = int(np.random.SeedSequence(entropy).generate_state(1)[0])
    return stream(recipe, run / "stream", seed, workers=workers, scheduler=scheduler)
