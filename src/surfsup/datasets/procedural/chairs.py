"""Random chairs made of boxes and cylinders, an alternative to ShapeNet.

Sizes are those of real chairs in meters, but no part is thinner than 0.035 m: much thinner walls do not stop the
solver's particles. A chair faces -y; x points from its right to its left side. The origin is on the floor below the
middle of the seat.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from surfsup.scene import Shape
from surfsup.scene.shapes import BoxShape, CylinderShape, Rotation

MIN_THICKNESS = 0.035  # meters

Random = np.random.Generator
Parts = list[Shape]


@dataclass(frozen=True)
class Measures:
    """The dimensions that all parts of a chair share, in meters.

    Attributes:
        width: of the seat, along x.
        depth: of the seat, along y.
        seat: height of the seat's upper side.
        board: thickness of the seat.
        post: thickness of legs and of the back's posts.
        rail: thickness of slats and stretchers.
    """

    width: float
    depth: float
    seat: float
    board: float
    post: float
    rail: float

    @property
    def underside(self) -> float:
        """The height inside the seat up to which its support reaches."""
        return self.seat - self.board / 2


def chair(random: Random) -> Shape:
    """A random chair, or sometimes a stool, standing on z = 0."""
    measures = Measures(
        width=random.uniform(0.4, 0.6),
        depth=random.uniform(0.38, 0.52),
        seat=random.uniform(0.34, 0.48),
        board=random.uniform(0.04, 0.08),
        post=random.uniform(0.04, 0.065),
        rail=random.uniform(MIN_THICKNESS, 0.045),
    )
    base = weighted_choice(random, {legs: 5, sled: 1, side_panels: 1, cantilever: 1, pedestal: 2})
    round_seat = base is pedestal and random.random() < 0.5
    parts = base(measures, random) + (disc_seat(measures) if round_seat else board_seat(measures, random))
    back = weighted_choice(random, {no_back: 1, panel: 2, upright_slats: 3, ladder: 3, cross: 1})
    if back is not no_back:
        lean = random.uniform(0.0, 11.0)
        hinge = (0.0, measures.depth / 2, measures.seat)
        frame = Shape(union=back(measures, random), rotate=Rotation(axis=(-1.0, 0.0, 0.0), degrees=lean), at=hinge)
        parts.append(frame)
    arms = weighted_choice(random, {no_arms: 4, arm_rests: 3, arm_panels: 1})
    return Shape(union=parts + ([] if round_seat or back is no_back else arms(measures, random)))


def weighted_choice(random: Random, weights: dict[Callable, int]) -> Callable:
    """One of the keys, with a probability proportional to its weight."""
    choices = [choice for choice, weight in weights.items() for _ in range(weight)]
    return choices[random.integers(len(choices))]


# The support of the seat.


def legs(m: Measures, random: Random) -> Parts:
    """Four legs, square or round, with or without stretchers."""
    inset = random.uniform(0.0, 0.05)
    x, y = m.width / 2 - m.post / 2 - inset, m.depth / 2 - m.post / 2 - inset
    leg = weighted_choice(random, {square_post: 1, round_post: 1})
    parts = [leg(side_x * x, side_y * y, 0.0, m.underside, m.post) for side_x in (-1, 1) for side_y in (-1, 1)]
    height = random.uniform(0.08, 0.6 * m.seat)
    half = m.rail / 2
    along_x = [beam((-x, y_at - half, height), (x, y_at + half, height + m.rail)) for y_at in (-y, y)]
    along_y = [beam((x_at - half, -y, height), (x_at + half, y, height + m.rail)) for x_at in (-x, x)]
    middle = [beam((-x, -half, height), (x, half, height + m.rail))]
    stretchers: tuple[Parts, ...] = ([], along_y, along_y + middle, along_x + along_y)
    return parts + stretchers[random.integers(len(stretchers))]


def sled(m: Measures, random: Random) -> Parts:
    """A closed frame on each side that stands on its lower rail."""
    x, y = m.width / 2 - m.post / 2, m.depth / 2 - m.post / 2 - random.uniform(0.0, 0.04)
    parts = [square_post(side_x * x, side_y * y, 0.0, m.underside, m.post) for side_x in (-1, 1) for side_y in (-1, 1)]
    return parts + runners(m, x, y)


def side_panels(m: Measures, random: Random) -> Parts:
    """A board on each side, joined by one between them."""
    thickness = random.uniform(0.04, 0.06)
    x, low = m.width / 2, random.uniform(0.1, 0.2)
    y = m.depth / 2 - random.uniform(0.0, 0.05)
    sides = [beam((low_x, -y, 0.0), (low_x + thickness, y, m.underside)) for low_x in (-x, x - thickness)]
    return [*sides, beam((-x + thickness / 2, y - 0.05, low), (x - thickness / 2, y - 0.05 + thickness, m.underside))]


def cantilever(m: Measures, random: Random) -> Parts:
    """Two posts at the front on runners, open at the back."""
    x, y = m.width / 2 - m.post / 2, m.depth / 2 - m.post / 2
    posts = [square_post(side * x, -y, 0.0, m.underside, m.post) for side in (-1, 1)]
    behind = beam((-x, y - m.post / 2, 0.0), (x, y + m.post / 2, m.post))
    return [*posts, *runners(m, x, y), behind]


def pedestal(m: Measures, random: Random) -> Parts:
    """One column on a disc or on a cross."""
    column = round_post(0.0, 0.0, 0.0, m.underside, random.uniform(0.06, 0.12))
    reach = random.uniform(0.7, 0.95) * min(m.width, m.depth) / 2
    thickness = random.uniform(0.04, 0.055)
    if random.random() < 0.5:
        return [column, round_post(0.0, 0.0, 0.0, thickness, 2 * reach)]
    bar = BoxShape(size=(2 * reach, 0.06, thickness))
    first = random.uniform(0.0, 90.0)
    count = int(random.integers(2, 4))
    return [column] + [
        Shape(box=bar, rotate=about_z(first + 180.0 * number / count), at=(0.0, 0.0, thickness / 2))
        for number in range(count)
    ]


def runners(m: Measures, x: float, y: float) -> Parts:
    """A rail on the floor on each side."""
    half = m.post / 2
    return [beam((x_at - half, -y - half, 0.0), (x_at + half, y + half, m.post)) for x_at in (-x, x)]


# The seat.


def board_seat(m: Measures, random: Random) -> Parts:
    """A board, sometimes with a cushion set into it."""
    x, y = m.width / 2, m.depth / 2
    board = beam((-x, -y, m.seat - m.board), (x, y, m.seat))
    if random.random() < 0.7:
        return [board]
    edge = random.uniform(0.03, 0.06)
    return [board, beam((-x + edge, -y + edge, m.underside), (x - edge, y - edge, m.seat + random.uniform(0.02, 0.04)))]


def disc_seat(m: Measures) -> Parts:
    """A round board that just reaches the back."""
    return [round_post(0.0, 0.0, m.seat - m.board, m.seat, m.depth + m.post)]


# The back. Its origin is the middle of the seat's rear edge.


def no_back(m: Measures, random: Random) -> Parts:
    """No back: a stool."""
    return []


def panel(m: Measures, random: Random) -> Parts:
    """One board down to the seat, as wide as the seat or narrower."""
    thickness = random.uniform(0.04, 0.07)
    x = m.width / 2 * random.uniform(0.8, 1.0)
    return [beam((-x, -thickness, -m.board), (x, 0.0, back_height(random)))]


def upright_slats(m: Measures, random: Random) -> Parts:
    """Posts, a rail at the top, and upright slats between it and the seat."""
    top = back_height(random)
    count = int(random.integers(2, 5))
    inner = m.width / 2 - m.post
    width = random.uniform(MIN_THICKNESS, max(MIN_THICKNESS, 0.75 * 2 * inner / (count + 1)))
    places = -inner + 2 * inner * (1 + np.arange(count)) / (count + 1)
    front, behind = -m.post / 2 - m.rail / 2, -m.post / 2 + m.rail / 2
    slats = [beam((x - width / 2, front, -m.board), (x + width / 2, behind, top)) for x in places]
    return [*posts(m, top), crosspiece(m, top - random.uniform(0.05, 0.1), top), *slats]


def ladder(m: Measures, random: Random) -> Parts:
    """Posts with crosspieces between them."""
    top = back_height(random)
    count = int(random.integers(2, 5))
    high = random.uniform(MIN_THICKNESS, 0.55 * top / count)
    return posts(m, top) + [crosspiece(m, level - high, level) for level in np.linspace(top, 0.3 * top, count)]


def cross(m: Measures, random: Random) -> Parts:
    """Posts, a rail above and below, and two diagonals between the rails."""
    top, low = back_height(random), random.uniform(0.06, 0.1)
    width, height = m.width - m.post, top - low
    bar = BoxShape(size=(float(np.hypot(width, height)), m.rail, m.rail))
    angle = float(np.degrees(np.arctan2(height, width)))
    middle = (0.0, -m.post / 2, (top + low - m.rail) / 2)
    diagonals = [
        Shape(box=bar, rotate=Rotation(axis=(0.0, 1.0, 0.0), degrees=tilt), at=middle) for tilt in (angle, -angle)
    ]
    return [*posts(m, top), crosspiece(m, top - m.rail, top), crosspiece(m, low - m.rail, low), *diagonals]


def back_height(random: Random) -> float:
    """Height from the seat to the top of the back, meters."""
    return random.uniform(0.28, 0.5)


def posts(m: Measures, top: float) -> Parts:
    """The two posts of a back, down into the seat."""
    x = m.width / 2 - m.post / 2
    return [square_post(side * x, -m.post / 2, -m.board, top, m.post) for side in (-1, 1)]


def crosspiece(m: Measures, low: float, high: float) -> Shape:
    """A slat from post to post."""
    x, y = m.width / 2 - m.post / 2, m.post / 2
    return beam((-x, -y - m.rail / 2, low), (x, -y + m.rail / 2, high))


# The arms.


def no_arms(m: Measures, random: Random) -> Parts:
    """No arms."""
    return []


def arm_rests(m: Measures, random: Random) -> Parts:
    """On each side a rest on a post at the front, set into the back."""
    level = m.seat + random.uniform(0.17, 0.24)
    width, x = random.uniform(0.045, 0.07), m.width / 2
    front = -m.depth / 2 + random.uniform(0.0, 0.08)
    rests = [beam((low, front, level - m.rail), (low + width, m.depth / 2, level)) for low in (-x, x - width)]
    middle = x - width / 2
    return rests + [
        square_post(side * middle, front + m.post / 2, m.underside, level - m.rail / 2, MIN_THICKNESS)
        for side in (-1, 1)
    ]


def arm_panels(m: Measures, random: Random) -> Parts:
    """A board on each side, set into the back."""
    level, thickness, x = m.seat + random.uniform(0.12, 0.22), random.uniform(0.04, 0.06), m.width / 2
    return [
        beam((low, -m.depth / 2, m.underside), (low + thickness, m.depth / 2, level)) for low in (-x, x - thickness)
    ]


# The primitives.


def beam(lower: tuple[float, float, float], upper: tuple[float, float, float]) -> Shape:
    """A box between two corners."""
    low, high = np.array(lower), np.array(upper)
    return Shape(box=BoxShape(size=tuple((high - low).tolist())), at=tuple(((low + high) / 2).tolist()))


def square_post(x: float, y: float, low: float, high: float, thickness: float) -> Shape:
    """An upright square post."""
    return beam((x - thickness / 2, y - thickness / 2, low), (x + thickness / 2, y + thickness / 2, high))


def round_post(x: float, y: float, low: float, high: float, thickness: float) -> Shape:
    """An upright round post, or a disc if it is wider than high."""
    return Shape(cylinder=CylinderShape(radius=thickness / 2, height=high - low), at=(x, y, (low + high) / 2))


def about_z(degrees: float) -> Rotation:
    """A rotation about the vertical."""
    return Rotation(axis=(0.0, 0.0, 1.0), degrees=degrees)
