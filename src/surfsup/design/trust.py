"""Whether gradients hold what they promise, and slopes measured by whole rollouts where they do not.

A gradient follows each particle on its way. It does not know that a particle beside the rim of a funnel would fall to
the other side of it were the rim a little wider: where many are near to such a choice, the reward rises where the
gradient says that it falls. And on rough ground it may be zero by chance. Rollouts tell; those without a way back cost
a sixteenth of a gradient. So where a gradient is in doubt, the slopes along two directions are measured over about a
step, and take its part along these; of two parameters that is all of it. In the other directions it stays (a control
variate; compare guided evolution strategies, Maheswaranathan et al. 2019). Where the rewards bend down on both sides in
every direction, the climb leaps to the top of their parabolas. Where it stands still they are looked for ever farther
off, for a trap narrower than a step is not where to stay.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from surfsup.design.ascent import Ascent
from surfsup.design.coordinates import Coordinates

BROKEN = 0.5  # a change of reward that is off by this share of what was promised, or came, breaks the promise
MOST_BROKEN = 2  # in a row, from which gradients are doubted
AT_STAKE = 0.02  # of all that was gained so far: less than that breaks no promise
LITTLE = 0.1  # of the usual: a gradient that promises less is doubted
NARROWEST = 0.1  # of a step: over less no slope is measured, for the ground is rough
WIDEST = 4.0  # steps over which a slope is measured at most, where the climb stands still

Score = Callable[[Tensor], float | None]


class Trust:
    """What the gradients of a climb have been worth.

    Attributes:
        doubted: whether they are in doubt.
        broken: promises broken in a row.
        still: measurements in a row before which the climb had hardly moved.
        memory: of the iteration before, by name: ``reward`` (), ``slope`` (P,), ``place`` (P,); empty at first.
    """

    def __init__(self) -> None:
        self.doubted, self.broken, self.still = False, 0, 0
        self.memory: dict[str, Tensor] = {}

    def weigh(self, ascent: Ascent, slope: Tensor, reward: float, gained: float) -> bool:
        """Compare what the last step brought with what the gradients at both its ends promised.

        Args:
            ascent: where the values are now.
            slope: the gradient (P,) there, in reward a step.
            reward: there.
            gained: by the best so far over the start.

        Returns:
            Whether the promise was kept. Afterwards ``doubted`` tells, too, whether the gradient promises hardly any
            gain within the ranges.
        """
        holds, place = True, ascent.place
        if self.memory:
            came = reward - float(self.memory["reward"])
            promised = float((self.memory["slope"] + slope) @ (place - self.memory["place"])) / 2
            holds = abs(came - promised) <= max(BROKEN * max(abs(came), abs(promised)), AT_STAKE * gained)
        self.broken = 0 if holds else self.broken + 1
        uphill = ascent.coordinates.inside(place + slope.sign() * ascent.free) - place
        little = float(slope @ uphill) < LITTLE * float(ascent.usual(slope) @ ascent.free.float())
        self.doubted = self.doubted or little or self.broken >= MOST_BROKEN
        self.memory = {"reward": torch.tensor(reward, dtype=torch.float64), "slope": slope, "place": place}
        return holds

    def measured(
        self, ascent: Ascent, slope: Tensor, reward: float, score: Score, random: np.random.Generator
    ) -> Measured:
        """The slope with its part along two directions measured; ends the doubt where the gradient was right there.

        Args:
            ascent: where the values are.
            slope: the gradient (P,) there.
            reward: there.
            score: the reward at a place (P,), None where it has none.
            random: of the second direction; the first is uphill.
        """
        place, free = ascent.place, ascent.free
        moved = ascent.memory["move"].abs()
        self.still = self.still + 1 if ascent.iteration and float(moved.max()) < NARROWEST else 0
        far = torch.where(moved == 0, 1.0, moved.clamp(NARROWEST, 1.0))
        far = (far * 2.0**self.still).clamp(max=WIDEST) * free
        first = torch.where(slope == 0, 1.0, slope.sign()) * far
        second = torch.from_numpy(random.standard_normal(len(far))).to(far) * far
        second = second - (second @ first) / (first @ first).clamp(min=1e-30) * first
        ways = (first, second * first.norm() / second.norm().clamp(min=1e-30))
        lines = [
            line
            for way in ways[: int(free.sum())]
            if (line := measured_line(ascent.coordinates, place, reward, way, score)) is not None
        ]
        if not lines:
            return Measured(slope, None)
        along = torch.stack([line.direction for line in lines], dim=1)
        found = torch.tensor([line.slope for line in lines])
        off = found - along.T @ slope
        self.doubted = float(off.norm()) >= BROKEN * float(found.norm())
        leap = None
        if len(lines) == int(free.sum()) and all(line.top is not None for line in lines):
            leap = along @ torch.tensor([line.top for line in lines])
        return Measured(slope + along @ torch.linalg.pinv(along.T @ along) @ off, leap)


@dataclass(frozen=True)
class Measured:
    """What rollouts told.

    Attributes:
        slope: (P,), in reward a step.
        leap: (P,) the way to the top, in steps, where the rewards along every direction bend down to one nearby.
    """

    slope: Tensor
    leap: Tensor | None


@dataclass(frozen=True)
class Line:
    """Rewards on a line through a place.

    Attributes:
        direction: (P,), of length 1.
        slope: along it, in reward a step.
        top: how far along it the parabola through three rewards has its top; None where it has none, or too far off.
    """

    direction: Tensor
    slope: float
    top: float | None


def measured_line(coordinates: Coordinates, place: Tensor, reward: float, way: Tensor, score: Score) -> Line | None:
    """The rewards at ``place`` ± ``way`` (P,), as far as the ranges go, beside that at ``place``; None of no way."""
    ends = []
    for end in (coordinates.inside(place + way), coordinates.inside(place - way)):
        found = score(end) if bool((end - place).norm() > NARROWEST / 2) else None
        ends.append((place, reward) if found is None else (end, found))
    (ahead, above), (behind, below) = ends
    length = float((ahead - behind).norm())
    if length == 0:
        return None
    slope, half, top = (above - below) / length, length / 2, None
    bend = (above + below - 2 * reward) / half**2
    if bool(torch.allclose(ahead + behind, 2 * place, atol=1e-4)) and bend < 0 and abs(slope) < -bend * half:
        top = -slope / bend
    return Line((ahead - behind) / length, slope, top)
