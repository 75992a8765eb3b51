"""What the correction objective asks of a predicted frame."""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup.model.correction import Correction
from surfsup.model.features import DISPLACEMENT_SCALE
from surfsup.model.neighbours import Neighbourhood
from surfsup.model.simulator import Observation
from surfsup.model.state import FRAME_TIME
from surfsup.scene import SPACING

Frame = tuple[Tensor, Tensor]  # positions and velocities

NEAR_SURFACE = 0.09  # metres, the supplement's threshold
NEAR_WEIGHT = 2.0
FLOOR = 0.05  # of a frame's mean squared correction: keeps frames at rest from dominating
RETURN = 0.3  # of the distance strayed from the truth that a frame is asked to make good
FARTHEST = 1.5e-3  # metres strayed, beyond which no more is asked
FASTEST = 0.3  # m/s that a velocity is off, likewise
ENERGY_CELL = 0.12  # metres
SQUEEZED = 0.03  # of the lattice's density: by as much does moving a particle by some DISPLACEMENT_SCALE change it


def wanted_correction(seen: Observation, before: Frame, after: Frame) -> Correction:
    """The correction that would lead from ``seen`` to the true velocities and by the true displacement.

    Where the state has strayed from the truth its place is asked to return only by a part: how far it strayed is mostly
    chaos that no state tells, and asking for all of it teaches the model to snap back, which pumps energy in. And where
    it has strayed far, in a splash, it is asked no more than if it had strayed a little: there the truth of a particle
    says nothing of the one that stands in its place, and would drown what can be learned.

    Args:
        seen: what the network saw.
        before: true positions (N, 3) in metres and velocities (N, 3) in m/s of the frame that was seen.
        after: the same one frame later.
    """
    strayed = (seen.state.positions - before[0]).detach()
    off = (seen.state.velocities - before[1]).detach()
    goal = after[0] + strayed - RETURN * at_most(strayed, FARTHEST)
    velocities = after[1] + off - at_most(off, FASTEST)
    gained = velocities - seen.state.velocities - FRAME_TIME * seen.gravity
    return Correction(gained * FRAME_TIME / DISPLACEMENT_SCALE, (goal - seen.ahead) / DISPLACEMENT_SCALE)


def at_most(vectors: Tensor, length: float) -> Tensor:
    """``vectors`` (N, 3), longer ones shortened to ``length``."""
    return vectors * (length / torch.linalg.vector_norm(vectors, dim=-1, keepdim=True).clamp(min=length))


def motion_loss(predicted: Correction, wanted: Correction, near: Tensor) -> Tensor:
    """Squared error of velocity and, twice, of position, over the root of the frame's own size.

    Dividing by the root lets calm frames count without letting them drown the impacts.

    Args:
        predicted: by the network.
        wanted: the truth.
        near: (N,) whether a particle is within NEAR_SURFACE of the solid.
    """
    error = squared_error(predicted, wanted)
    weight = torch.where(near, NEAR_WEIGHT, 1.0)
    # Without a gradient: else a frame could be made to look easier by straying further in the one before.
    size = wanted.velocity.detach().square().sum(dim=-1).mean()
    return (weight * error).sum() / weight.sum() / (size + FLOOR).sqrt()


def squared_error(predicted: Correction, wanted: Correction) -> Tensor:
    """Squared error of velocity and, twice, of position, of each particle (N,)."""
    error = (predicted.velocity - wanted.velocity).square().sum(dim=-1)
    return error + 2 * (predicted.position - wanted.position).square().sum(dim=-1)


def energy_loss(velocities: Tensor, true_velocities: Tensor, places: Tensor, shift: Tensor) -> Tensor:
    """Error of the kinetic energy of small cells of fluid.

    A prediction that is right on the mean loses the energy of all that it cannot know; asking for the energy of
    a cell rather than of a particle gives it back without asking for what is chaotic.

    Args:
        velocities: (N, 3) predicted, m/s.
        true_velocities: (N, 3), m/s.
        places: (N, 3) true positions, metres: they say which cell a particle counts in.
        shift: (3,) offset of the cells, metres.
    """
    scale = FRAME_TIME / DISPLACEMENT_SCALE
    energy = 0.5 * (velocities * scale).square().sum(dim=-1)
    true_energy = 0.5 * (true_velocities * scale).square().sum(dim=-1)
    cell = ((places + shift) / ENERGY_CELL).floor().long()
    _, cell = torch.unique(cell, dim=0, return_inverse=True)
    cells = int(cell.max()) + 1
    total, true_total, count = (
        energy.new_zeros(cells).index_add(0, cell, values) for values in (energy, true_energy, torch.ones_like(energy))
    )
    return ((total - true_total).square() / (true_total + count)).sum() / len(places)


def density_loss(positions: Tensor, near: Neighbourhood) -> Tensor:
    """How far the fluid is squeezed beyond the density that the solver never lets it exceed.

    The solver's pressure holds every particle at or below the lattice's density, in every frame (measured: 1.000 is
    the highest). A model that is nearly right in each frame drifts above that in hundreds, and nothing in a single
    frame's error tells it so.

    Args:
        positions: (N, 3) predicted, metres.
        near: at least all pairs within the kernel's support, for positions about these.
    """
    apart = positions.index_select(0, near.senders) - positions.index_select(0, near.receivers)
    density = lattice_density(apart.square().sum(dim=-1), near)
    return ((density - 1).clamp(min=0) / SQUEEZED).square().mean()


def lattice_density(squared: Tensor, near: Neighbourhood) -> Tensor:
    """The density (N,) in units of the lattice's, from the squared distances (E,) of neighbours in m².

    The solver's cubic spline kernel, as in :func:`surfsup.datasets.density.number_density`.
    """
    support = 2 * SPACING
    # The root has no slope at zero, where two particles lie on top of each other.
    q = (squared / support**2).clamp(min=1e-8).sqrt()
    kernel = torch.where(q <= 0.5, 6 * (q**3 - q**2) + 1, 2 * (1 - q).clamp(min=0) ** 3)
    own = squared.new_ones(len(near.starts) - 1)
    return own.index_add(0, near.receivers, kernel) * (8 / (torch.pi * support**3) * SPACING**3)
