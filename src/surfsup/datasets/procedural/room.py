"""A furnished room, open at the top and cut away at the front, as a union of boxes and cylinders.

It is a doll's house: 1.9 m wide, with no part thinner than 0.035 m. x points to the right, y to the back.
"""

from __future__ import annotations

from surfsup.datasets.procedural.chairs import Parts, beam, round_post, square_post
from surfsup.scene import Shape
from surfsup.scene.shapes import ConeShape, SphereShape

HALF = 0.95  # meters from the middle to the outside of a wall
WALL = 0.05
FLOOR = 0.05
HIGH, LOW = 0.95, 0.22  # meters: heights of the walls at the back and left, and at the front and right


def room() -> Shape:
    """The room with its furniture, standing on z = 0."""
    parts = walls() + table(0.28, -0.38) + sofa() + bookcase() + bed()
    parts += chair(0.28, -0.68, 1) + chair(0.28, -0.08, -1) + chair(0.56, -0.38, 0)
    return Shape(union=parts + lamp(-0.78, 0.76) + plant(0.02, 0.75) + low_table(-0.3, -0.25))


def walls() -> Parts:
    """Floor, two high walls, one with a window, and two low ones."""
    inner = HALF - WALL
    left, right, sill, lintel = -0.55, -0.05, 0.48, 0.8  # the window
    return [
        beam((-HALF, -HALF, 0.0), (HALF, HALF, FLOOR)),
        beam((-HALF, -HALF, 0.0), (-inner, HALF, HIGH)),
        beam((-HALF, inner, 0.0), (left, HALF, HIGH)),
        beam((right, inner, 0.0), (HALF, HALF, HIGH)),
        beam((left, inner, 0.0), (right, HALF, sill)),
        beam((left, inner, lintel), (right, HALF, HIGH)),
        beam((left - 0.02, inner - 0.06, sill - 0.04), (right + 0.02, HALF, sill)),
        square_post((left + right) / 2, HALF - WALL / 2, sill, lintel, 0.04),
        beam((left, inner + 0.005, (sill + lintel) / 2 - 0.02), (right, HALF - 0.005, (sill + lintel) / 2 + 0.02)),
        beam((-HALF, -HALF, 0.0), (HALF, -inner, LOW)),
        beam((inner, -HALF, 0.0), (HALF, HALF, LOW)),
    ]


def table(x: float, y: float) -> Parts:
    """A dining table with a jug and a loaf on it."""
    top = FLOOR + 0.3
    legs = [square_post(x + dx, y + dy, FLOOR, top, 0.045) for dx in (-0.17, 0.17) for dy in (-0.13, 0.13)]
    jug = round_post(x - 0.08, y + 0.02, top, top + 0.13, 0.09)
    loaf = beam((x + 0.02, y - 0.1, top), (x + 0.16, y - 0.03, top + 0.06))
    return [beam((x - 0.22, y - 0.18, top - 0.04), (x + 0.22, y + 0.18, top)), *legs, jug, loaf]


def chair(x: float, y: float, faces: int) -> Parts:
    """A small chair that faces +y (1), -y (-1) or -x (0)."""
    seat, side = FLOOR + 0.18, 0.085
    legs = [square_post(x + dx, y + dy, FLOOR, seat, 0.036) for dx in (-0.065, 0.065) for dy in (-0.065, 0.065)]
    board = beam((x - side, y - side, seat - 0.036), (x + side, y + side, seat))
    back = {
        1: beam((x - side, y - side, seat - 0.036), (x + side, y - side + 0.036, seat + 0.2)),
        -1: beam((x - side, y + side - 0.036, seat - 0.036), (x + side, y + side, seat + 0.2)),
        0: beam((x + side - 0.036, y - side, seat - 0.036), (x + side, y + side, seat + 0.2)),
    }[faces]
    return [*legs, board, back]


def sofa() -> Parts:
    """A sofa at the left wall: a base, a back, arms, two cushions and feet."""
    x, low, high = -HALF + WALL, -0.62, 0.1
    feet = [square_post(x + dx, y, FLOOR, FLOOR + 0.08, 0.05) for dx in (0.05, 0.27) for y in (low + 0.05, high - 0.05)]
    return [
        beam((x, low, FLOOR + 0.05), (x + 0.32, high, FLOOR + 0.13)),
        beam((x, low, FLOOR + 0.05), (x + 0.1, high, FLOOR + 0.34)),
        beam((x, low, FLOOR + 0.05), (x + 0.32, low + 0.08, FLOOR + 0.24)),
        beam((x, high - 0.08, FLOOR + 0.05), (x + 0.32, high, FLOOR + 0.24)),
        beam((x + 0.1, low + 0.085, FLOOR + 0.13), (x + 0.31, (low + high) / 2 - 0.005, FLOOR + 0.17)),
        beam((x + 0.1, (low + high) / 2 + 0.005, FLOOR + 0.13), (x + 0.31, high - 0.085, FLOOR + 0.17)),
        *feet,
    ]


def bookcase() -> Parts:
    """A bookcase at the back wall: five boards, two sides, and books of different heights."""
    left, right, front, wall, top = 0.3, 0.84, 0.72, HALF - WALL, 0.86
    boards = [
        beam((left, front, level), (right, wall, level + 0.036)) for level in (FLOOR, 0.25, 0.45, 0.65, top - 0.036)
    ]
    sides = [beam((x, front, FLOOR), (x + 0.036, wall, top)) for x in (left, right - 0.036)]
    shelves = ((0.286, "8.75.86"), (0.486, "57.8..6"), (0.686, "..78.56"), (FLOOR + 0.036, "8866.8."))
    books = [
        beam((x, front + 0.02, level - 0.005), (x + 0.05, wall, level + 0.02 * int(height)))
        for level, row in shelves
        for x, height in zip([left + 0.06 + 0.062 * place for place in range(7)], row, strict=True)
        if height != "."
    ]
    return boards + sides + books


def bed() -> Parts:
    """A bed in the right corner at the back: a frame, a mattress, a pillow and a headboard."""
    x, low, high = HALF - WALL, 0.14, 0.66
    return [
        beam((x - 0.32, low, FLOOR), (x, high, FLOOR + 0.1)),
        beam((x - 0.31, low + 0.01, FLOOR + 0.1), (x - 0.01, high - 0.045, FLOOR + 0.16)),
        beam((x - 0.26, high - 0.18, FLOOR + 0.15), (x - 0.06, high - 0.06, FLOOR + 0.2)),
        beam((x - 0.32, high - 0.045, FLOOR), (x, high, FLOOR + 0.32)),
    ]


def lamp(x: float, y: float) -> Parts:
    """A standard lamp."""
    shade = Shape(cone=ConeShape(height=0.16, bottom_radius=0.11, top_radius=0.065), at=(x, y, FLOOR + 0.62))
    return [
        round_post(x, y, FLOOR, FLOOR + 0.036, 0.17),
        round_post(x, y, FLOOR, FLOOR + 0.6, 0.04),
        shade,
    ]


def plant(x: float, y: float) -> Parts:
    """A pot with a round bush."""
    pot = Shape(cone=ConeShape(height=0.14, bottom_radius=0.055, top_radius=0.085), at=(x, y, FLOOR + 0.07))
    bush = [
        Shape(sphere=SphereShape(radius=radius), at=(x + dx, y + dy, FLOOR + up))
        for dx, dy, up, radius in ((0.0, 0.0, 0.24, 0.1), (0.06, -0.03, 0.32, 0.07), (-0.06, 0.02, 0.33, 0.075))
    ]
    return [pot, *bush]


def low_table(x: float, y: float) -> Parts:
    """A round table in front of the sofa."""
    return [
        round_post(x, y, FLOOR + 0.12, FLOOR + 0.16, 0.3),
        round_post(x, y, FLOOR, FLOOR + 0.13, 0.06),
        round_post(x, y, FLOOR, FLOOR + 0.036, 0.18),
    ]
