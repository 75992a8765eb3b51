"""Scenes of different sizes that flow alike."""

import math

from surfsup.scene import PARTICLE_RADIUS, Block, Container, Scene, Shape


def similar_scene(factor: float, frames: int = 40, **values: float) -> Scene:
    """Water thrown at a tilted box, ``factor`` times as large as with particles of 15 mm."""
    s = factor

    def scaled(*lengths: float) -> tuple[float, ...]:
        return tuple(s * length for length in lengths)

    return Scene(
        container=Container(size=scaled(1.0, 0.9, 1.2)),
        surface=Shape.model_validate(
            {
                "box": {"size": scaled(0.3, 0.25, 0.2)},
                "rotate": {"axis": [0, 1, 0], "degrees": 20},
                "at": scaled(0.1, 0.0, 0.2),
            }
        ),
        fluid=[
            Block(scaled(-0.2, -0.15, 0.25), scaled(0.15, 0.2, 0.6), velocity=(math.sqrt(s), 0.0, -2 * math.sqrt(s)))
        ],
        particle_radius=s * PARTICLE_RADIUS,
        frames=frames,
        **values,
    )
