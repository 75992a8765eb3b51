"""Rigid motions between two poses as operations of torch, differentiable in the poses.

The same as in ``native/sph/rigid_motion.cpp``. A solid moves on a straight line at constant speed and turns about a
fixed axis at constant rate, the shorter way.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

TINY = 1e-30  # squared, below any length that counts: roots of sums have a derivative at zero with it


class RigidStep(NamedTuple):
    """Where solids are at one time, and the velocities of their points until a later one, or since an earlier one.

    Attributes:
        rotation: (..., 3, 3) from the frame of the solid to the world.
        translation: (..., 3), meters.
        turn: (..., 3, 3) from the arm of a point about ``translation`` to its velocity, 1/s.
        drift: (..., 3) velocity of the frame's origin, m/s.
    """

    rotation: Tensor
    translation: Tensor
    turn: Tensor
    drift: Tensor

    def of(self, index: int) -> RigidStep:
        """That of the solid with an index in the last of the leading dimensions."""
        rotation, translation, turn, drift = self
        return RigidStep(
            rotation[..., index, :, :], translation[..., index, :], turn[..., index, :, :], drift[..., index, :]
        )

    def to(self, like: Tensor) -> RigidStep:
        """The same on the device and in the precision of a tensor."""
        return RigidStep(*(value.to(like.device, like.dtype) for value in self))

    def to_own(self, points: Tensor) -> Tensor:
        """World points (N, 3) in the frame of one solid."""
        return (points - self.translation) @ self.rotation

    def to_world(self, own: Tensor) -> Tensor:
        """Points (N, 3) in the frame of one solid in the world."""
        return own @ self.rotation.T + self.translation

    def velocity(self, points: Tensor) -> Tensor:
        """Velocity (N, 3) in m/s of the material points of one solid at world points (N, 3)."""
        return (points - self.translation) @ self.turn.T + self.drift


class Places(NamedTuple):
    """Where K solids are at equally spaced times.

    Attributes:
        rotations: (S + 1, K, 3, 3) from the frame of a solid to the world.
        positions: (S + 1, K, 3), meters.
        seconds: from the first to the last.
    """

    rotations: Tensor
    positions: Tensor
    seconds: float

    def steps(self) -> RigidStep:
        """The S steps of the K solids, each with the place at its start."""
        rotations, positions, seconds = self
        time = seconds / (len(rotations) - 1)
        turn = (rotations[1:] - rotations[:-1]) @ rotations[:-1].transpose(-1, -2) / time
        return RigidStep(rotations[:-1], positions[:-1], turn, (positions[1:] - positions[:-1]) / time)

    def at(self, number: int) -> RigidStep:
        """The K solids at one of the times, with their mean velocities from the first to the last."""
        rotations, positions, seconds = self
        turn = (rotations[-1] - rotations[0]) @ rotations[number].transpose(-1, -2) / seconds
        return RigidStep(rotations[number], positions[number], turn, (positions[-1] - positions[0]) / seconds)


def places_between(ends: Tensor, count: int, seconds: float) -> Places:
    """Where K solids are at the start and the end of each of ``count`` substeps.

    Args:
        ends: (K, 2, 7) poses at the start and the end of the motion: positions in meters and quaternions w, x, y, z of
            any length but zero.
        count: of the substeps.
        seconds: from start to end.
    """
    return Places(*place_at(ends, torch.linspace(0, 1, count + 1, dtype=torch.float64)), seconds)


def place_at(ends: Tensor, parts: Tensor) -> tuple[Tensor, Tensor]:
    """Rotations (S, K, 3, 3) and positions (S, K, 3) at fractions (S,) of motions between ``ends`` (K, 2, 7)."""
    poses = interpolated(ends, parts)
    w, x, y, z = poses[..., 3:].unbind(dim=-1)
    matrix = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    ]
    return torch.stack(matrix, dim=-1).unflatten(-1, (3, 3)), poses[..., :3]


def interpolated(ends: Tensor, parts: Tensor) -> Tensor:
    """The poses (S, K, 7) at fractions (S,) of motions between ``ends`` (K, 2, 7); quaternions of length one."""
    part = parts.to(ends)[:, None, None]
    position = (1 - part) * ends[:, 0, :3] + part * ends[:, 1, :3]
    start, end = torch.nn.functional.normalize(ends[..., 3:], dim=-1).unbind(dim=1)
    turn = product(start * start.new_tensor([1.0, -1.0, -1.0, -1.0]), end)
    turn = torch.where(turn[:, :1] < 0, -turn, turn)
    sine = (turn[:, 1:].square().sum(dim=-1, keepdim=True) + TINY).sqrt()
    half_angle = torch.atan2(sine, turn[:, :1])
    axis = turn[:, 1:] / sine
    partial = torch.cat([torch.cos(part * half_angle), torch.sin(part * half_angle) * axis], dim=-1)
    return torch.cat([position, product(start.expand_as(partial), partial)], dim=-1)


def product(one: Tensor, other: Tensor) -> Tensor:
    """The rotation (..., 4) by ``other``, then by ``one``, as quaternions."""
    w, x, y, z = one.unbind(dim=-1)
    a, b, c, d = other.unbind(dim=-1)
    return torch.stack(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ],
        dim=-1,
    )
