"""Two hollow solids, the bowl and the funnel, with the origin at the center of the mouth.

The design tasks of section 7 of the SURFSUP supplement optimize them: the capture radius r1 is the inner radius of the
mouth, the filter radius r2 that of the hole below. Each solid is a curve in the (radial, axial) half plane, thickened
by half a wall to either side and revolved about z. The distance is exact outside and a bound inside the wall. Sizes
are in meters, numbers or tensors that may require a gradient.
"""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup import native
from surfsup.errors import InputError
from surfsup.sdf.primitives import length, positive
from surfsup.sdf.surface import Surface

# Meters. With the clearance of particles on either side it exceeds the 0.07 m that the fastest move in a frame.
WALL = 0.04


class Bowl(Surface):
    """A hemisphere open above with inner radius ``capture_radius`` and a round hole of ``filter_radius`` at the bottom.

    A filter radius of zero closes the bowl.

    Examples:
        >>> import torch
        >>> surface = Bowl(capture_radius=0.25, filter_radius=0.05)
        >>> bool(surface.distance(torch.tensor([[0.0, 0.0, -0.1]])) > 0)  # hollow
        True
    """

    capture_radius: Tensor
    filter_radius: Tensor
    wall: Tensor

    def __init__(
        self, capture_radius: float | Tensor, filter_radius: float | Tensor = 0.0, wall: float | Tensor = WALL
    ) -> None:
        super().__init__()
        self.register_buffer("capture_radius", positive("bowl", "capture_radius", capture_radius))
        self.register_buffer("filter_radius", hole_radius("bowl", filter_radius, self.capture_radius))
        self.register_buffer("wall", positive("bowl", "wall", wall))

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,), exact outside, a bound inside.

        The distance is that to the closed bowl, unless the hole has removed the nearest point of the closed bowl. Then
        the nearest point is on the face of the hole or on the rim.
        """
        radial, axial = length(points[:, :2]), points[:, 2]
        middle = self.capture_radius + self.wall / 2
        from_center = length(points)
        to_rim = length(torch.stack([radial - middle, axial], dim=-1)) - self.wall / 2
        to_closed = torch.where(axial > 0, to_rim, (from_center - middle).abs() - self.wall / 2)

        with torch.no_grad():
            nearest = from_center.clamp(self.capture_radius, self.capture_radius + self.wall)
            radial_of_nearest = radial * nearest / from_center.clamp(min=torch.finfo(points.dtype).tiny)
            removed = (axial <= 0) & (radial_of_nearest < self.filter_radius)
        below, above = self.hole_ends()
        beside = axial - torch.minimum(torch.maximum(axial, below), above)
        to_hole = length(torch.stack([self.filter_radius - radial, beside], dim=-1))
        # A hole of radius zero has no face.
        beside_hole = torch.where(self.filter_radius > 0, self.filter_radius - radial, -self.wall)
        return torch.where(removed, torch.minimum(to_hole, to_rim), torch.maximum(to_closed, beside_hole))

    def hole_ends(self) -> tuple[Tensor, Tensor]:
        """The lower and the upper height of the hole's face, at the outer and the inner side of the wall."""
        outer = self.capture_radius + self.wall
        return (
            -(outer.square() - self.filter_radius.square()).sqrt(),
            -(self.capture_radius.square() - self.filter_radius.square()).sqrt(),
        )

    def native_solid(self) -> native.Solid:
        """The same solid for the native code."""
        return native.Solid("bowl", [float(self.capture_radius), float(self.filter_radius), float(self.wall)], [])

    def bounds(self) -> Tensor:
        """The bounding box (2, 3)."""
        outer = self.capture_radius + self.wall
        lowest, _ = self.hole_ends()
        return torch.stack([torch.stack([-outer, -outer, lowest]), torch.stack([outer, outer, self.wall / 2])])


class Funnel(Surface):
    """A cone that narrows over ``height`` from ``capture_radius`` to ``filter_radius``, then a straight ``spout``.

    Examples:
        >>> import torch
        >>> surface = Funnel(capture_radius=0.25, filter_radius=0.05)
        >>> bool(surface.distance(torch.tensor([[0.0, 0.0, -0.1]])) > 0)  # hollow
        True
    """

    capture_radius: Tensor
    filter_radius: Tensor
    height: Tensor
    spout: Tensor
    wall: Tensor

    def __init__(
        self,
        capture_radius: float | Tensor,
        filter_radius: float | Tensor,
        height: float | Tensor = 0.25,
        spout: float | Tensor = 0.1,
        wall: float | Tensor = WALL,
    ) -> None:
        super().__init__()
        self.register_buffer("capture_radius", positive("funnel", "capture_radius", capture_radius))
        self.register_buffer("filter_radius", positive("funnel", "filter_radius", filter_radius))
        self.register_buffer("height", positive("funnel", "height", height))
        self.register_buffer("spout", positive("funnel", "spout", spout))
        self.register_buffer("wall", positive("funnel", "wall", wall))

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,), exact outside, a bound inside."""
        profile = torch.stack([length(points[:, :2]), points[:, 2]], dim=-1)
        rim = torch.stack([self.capture_radius + self.wall / 2, torch.zeros_like(self.height)])
        neck = torch.stack([self.filter_radius + self.wall / 2, -self.height])
        outlet = torch.stack([self.filter_radius + self.wall / 2, -self.height - self.spout])
        cone, spout = distance_to_segment(profile, rim, neck), distance_to_segment(profile, neck, outlet)
        return torch.minimum(cone, spout) - self.wall / 2

    def native_solid(self) -> native.Solid:
        """The same solid for the native code."""
        return native.Solid(
            "funnel",
            [float(size) for size in (self.capture_radius, self.filter_radius, self.height, self.spout, self.wall)],
            [],
        )

    def bounds(self) -> Tensor:
        """The bounding box (2, 3)."""
        outer = torch.maximum(self.capture_radius, self.filter_radius) + self.wall
        lowest = -self.height - self.spout - self.wall / 2
        return torch.stack([torch.stack([-outer, -outer, lowest]), torch.stack([outer, outer, self.wall / 2])])


def distance_to_segment(points: Tensor, start: Tensor, end: Tensor) -> Tensor:
    """The distance (N,) of ``points`` (N, 2) from the line segment between ``start`` and ``end`` (2,)."""
    start, along = start.to(points.dtype), (end - start).to(points.dtype)
    fraction = ((points - start) @ along / along.square().sum()).clamp(0, 1)
    return length(points - start - fraction[:, None] * along)


def hole_radius(shape_name: str, radius: float | Tensor, mouth: Tensor) -> Tensor:
    """``radius`` as a floating-point tensor, at least zero and smaller than that of the ``mouth``.

    Raises:
        InputError: It is not; the message names the shape.
    """
    if isinstance(radius, int | float | Tensor) and torch.as_tensor(radius).numel() == 1 and radius == 0:
        return torch.as_tensor(radius, dtype=mouth.dtype)
    tensor = positive(shape_name, "filter_radius", radius)
    if not bool(tensor.detach() < mouth.detach()):
        raise InputError(
            f"{shape_name}: filter_radius is {float(tensor.detach()):.4g} m, but must be smaller than the "
            f"capture_radius of {float(mouth.detach()):.4g} m, or the bowl is empty"
        )
    return tensor
