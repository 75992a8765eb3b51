"""What module.cpp shows; matrices are as torch keeps them, a row an output."""

import numpy as np

Matrix = Bias = Vectors = Values = Vector = np.ndarray

def paths() -> list[str]:
    """Instruction sets that this processor has and the step is compiled for, the fastest first."""

class Solid:
    """A solid whose distance has a closed form; ``parts`` are copied."""

    def __init__(self, kind: str, numbers: list[float], parts: list[Solid]) -> None:
        """Check the kind and what it is made of.

        Raises:
            ValueError: there is no such kind, or it has other numbers or parts.
        """

    def look(self, points: Vectors, distance: Values, normal: Vectors, threads: int) -> None:
        """Write the signed distance (N,) and the unit normal (N, 3) of ``points`` (N, 3), all float32.

        Raises:
            ValueError: sizes do not fit.
        """

class Network:
    """The convolution's network, its weights copied, and the memory of its steps."""

    def __init__(
        self,
        *,
        encoder: tuple[Matrix, Matrix],
        factors: tuple[Matrix, Bias, Matrix, Bias],
        layers: list[tuple[Matrix, Matrix, Matrix]],
        decoder: tuple[Matrix, Matrix],
        radius: float,
        close: float,
        frame_time: float,
        fall_lag: float,
        reach: float,
        displacement_scale: float,
        velocity_scale: float,
        crowded: float,
        position_share: float,
    ) -> None:
        """Copy the weights.

        Raises:
            ValueError: sizes do not fit.
        """

    def step(
        self,
        positions: Vectors,
        velocities: Vectors,
        displacement: Vectors,
        velocity_change: Vectors,
        ahead: Vectors,
        distance: Values,
        normal: Vectors,
        gravity: Vector,
        lower: Vector,
        upper: Vector,
        new_positions: Vectors,
        new_velocities: Vectors,
        path: str,
        threads: int,
        most_edges: int,
    ) -> int:
        """Write the positions and velocities of the next frame, before the guard; return the number of edges.

        Every array is float32; those of particles are (N, 3), distance is (N,). It returns -1 where an entry of
        ``ahead`` is not finite. With more than ``most_edges`` it stops and has written nothing.

        Raises:
            ValueError: sizes do not fit, or the processor cannot go the path.
            MemoryError: the neighbours do not fit into memory.
        """
