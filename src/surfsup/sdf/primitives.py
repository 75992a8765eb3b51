"""Five solids whose exact distance has a closed form, each centered on the origin, its axis along z.

The formulas are those collected by Inigo Quilez ("Distance functions", cited in section 5.1 of the SURFSUP
supplement). Sizes are in meters. Each may be a number or a tensor, which keeps its precision and its gradient.
Distances have the precision of the points.
"""

from __future__ import annotations

import torch
from torch import Tensor

from surfsup import native
from surfsup.errors import InputError
from surfsup.sdf.surface import Surface


class Sphere(Surface):
    """A ball of ``radius``.

    Examples:
        >>> import torch
        >>> Sphere(0.25).distance(torch.tensor([[0.0, 0.0, 0.5], [0.0, 0.0, 0.0]])).tolist()
        [0.25, -0.25]
    """

    radius: Tensor

    def __init__(self, radius: float | Tensor) -> None:
        super().__init__()
        self.register_buffer("radius", positive("sphere", "radius", radius))

    def distance(self, points: Tensor) -> Tensor:
        """Exact signed distance (N,)."""
        return length(points) - self.radius

    def native_solid(self) -> native.Solid:
        """The same solid for the native code."""
        return native.Solid("sphere", [float(self.radius)], [])

    def bounds(self) -> Tensor:
        """The bounding cube (2, 3)."""
        return symmetric_bounds(self.radius, self.radius, self.radius)


class Box(Surface):
    """A box with the three side lengths ``size`` along x, y and z.

    Examples:
        >>> import torch
        >>> Box((0.5, 0.25, 1.0)).distance(torch.tensor([[0.5, 0.0, 0.0]])).item()
        0.25
    """

    size: Tensor

    def __init__(self, size: tuple[float, float, float] | Tensor) -> None:
        super().__init__()
        self.register_buffer("size", positive("box", "size", size, shape=(3,)))

    def distance(self, points: Tensor) -> Tensor:
        """Exact signed distance (N,)."""
        beyond = points.abs() - (self.size / 2).to(points.dtype)
        return length(beyond.clamp(min=0)) + beyond.amax(dim=-1).clamp(max=0)

    def native_solid(self) -> native.Solid:
        """The same solid for the native code."""
        return native.Solid("box", self.size.tolist(), [])

    def bounds(self) -> Tensor:
        """The box itself (2, 3)."""
        return symmetric_bounds(*(self.size / 2))


class Cylinder(Surface):
    """A cylinder of ``radius`` and total ``height`` along z.

    Examples:
        >>> import torch
        >>> Cylinder(radius=0.1, height=0.5).distance(torch.tensor([[0.0, 0.0, 0.5]])).item()
        0.25
    """

    radius: Tensor
    height: Tensor

    def __init__(self, radius: float | Tensor, height: float | Tensor) -> None:
        super().__init__()
        self.register_buffer("radius", positive("cylinder", "radius", radius))
        self.register_buffer("height", positive("cylinder", "height", height))

    def distance(self, points: Tensor) -> Tensor:
        """Exact signed distance (N,)."""
        beyond = torch.stack([length(points[:, :2]) - self.radius, points[:, 2].abs() - self.height / 2], dim=-1)
        return length(beyond.clamp(min=0)) + beyond.amax(dim=-1).clamp(max=0)

    def native_solid(self) -> native.Solid:
        """The same solid for the native code."""
        return native.Solid("cylinder", [float(self.radius), float(self.height)], [])

    def bounds(self) -> Tensor:
        """The bounding box (2, 3)."""
        return symmetric_bounds(self.radius, self.radius, self.height / 2)


class CappedCone(Surface):
    """A cone frustum along z: ``bottom_radius`` at -height/2, ``top_radius`` at +height/2.

    Examples:
        >>> import torch
        >>> CappedCone(height=0.5, bottom_radius=0.2).distance(torch.tensor([[0.0, 0.0, -0.5]])).item()
        0.25
    """

    height: Tensor
    bottom_radius: Tensor
    top_radius: Tensor

    def __init__(
        self, height: float | Tensor, bottom_radius: float | Tensor, top_radius: float | Tensor = 0.01
    ) -> None:
        super().__init__()
        self.register_buffer("height", positive("cone", "height", height))
        self.register_buffer("bottom_radius", positive("cone", "bottom_radius", bottom_radius))
        self.register_buffer("top_radius", positive("cone", "top_radius", top_radius))

    def distance(self, points: Tensor) -> Tensor:
        """Exact signed distance (N,).

        In the (radial, axial) half plane the solid is a convex polygon. Next to a rim the distance is that to the
        rim, everywhere else it is the largest of the signed distances to the edges. The usual formula, the smallest
        unsigned distance with a sign, has no gradient on the surface itself.
        """
        half = self.height / 2
        radial, axial = length(points[:, :2]), points[:, 2]
        slope = self.top_radius - self.bottom_radius
        slant = torch.sqrt(slope**2 + self.height**2)
        side_radial, side_axial = slope / slant, self.height / slant  # unit vector up the side

        beyond_bottom, above_bottom = radial - self.bottom_radius, axial + half
        beyond_top, above_top = radial - self.top_radius, axial - half
        to_side = beyond_bottom * side_axial - above_bottom * side_radial
        to_edges = torch.maximum(to_side, axial.abs() - half)

        next_to_bottom = (beyond_bottom > 0) & (beyond_bottom * side_radial + above_bottom * side_axial < 0)
        next_to_top = (beyond_top > 0) & (beyond_top * side_radial + above_top * side_axial > 0)
        to_bottom = length(torch.stack([beyond_bottom, above_bottom], dim=-1))
        to_top = length(torch.stack([beyond_top, above_top], dim=-1))
        return torch.where(next_to_bottom, to_bottom, torch.where(next_to_top, to_top, to_edges))

    def native_solid(self) -> native.Solid:
        """The same solid for the native code."""
        return native.Solid("cone", [float(self.height), float(self.bottom_radius), float(self.top_radius)], [])

    def bounds(self) -> Tensor:
        """The bounding box (2, 3)."""
        widest = torch.maximum(self.bottom_radius, self.top_radius)
        return symmetric_bounds(widest, widest, self.height / 2)


class Torus(Surface):
    """A ring around z: a circle of ``minor_radius`` swept at ``major_radius`` from the axis.

    Examples:
        >>> import torch
        >>> Torus(major_radius=0.25, minor_radius=0.125).distance(torch.zeros(1, 3)).item()
        0.125
    """

    major_radius: Tensor
    minor_radius: Tensor

    def __init__(self, major_radius: float | Tensor, minor_radius: float | Tensor) -> None:
        super().__init__()
        self.register_buffer("major_radius", positive("torus", "major_radius", major_radius))
        self.register_buffer("minor_radius", positive("torus", "minor_radius", minor_radius))

    def distance(self, points: Tensor) -> Tensor:
        """Signed distance (N,), exact if minor_radius <= major_radius."""
        from_circle = torch.stack([length(points[:, :2]) - self.major_radius, points[:, 2]], dim=-1)
        return length(from_circle) - self.minor_radius

    def native_solid(self) -> native.Solid:
        """The same solid for the native code."""
        return native.Solid("torus", [float(self.major_radius), float(self.minor_radius)], [])

    def bounds(self) -> Tensor:
        """The bounding box (2, 3)."""
        outer = self.major_radius + self.minor_radius
        return symmetric_bounds(outer, outer, self.minor_radius)


def length(vectors: Tensor) -> Tensor:
    """Euclidean length over the last axis; its gradients of every order are zero at zero, not NaN."""
    squared = vectors.square().sum(dim=-1)
    nonzero = squared > 0
    return torch.where(nonzero, torch.where(nonzero, squared, 1.0).sqrt(), 0.0)


def symmetric_bounds(x: Tensor, y: Tensor, z: Tensor) -> Tensor:
    """The box (2, 3) from (-x, -y, -z) to (x, y, z)."""
    corner = torch.stack([x, y, z])
    return torch.stack([-corner, corner])


def positive(shape_name: str, name: str, value: object, shape: tuple[int, ...] = ()) -> Tensor:
    """``value`` as a floating-point tensor of ``shape`` with finite, positive entries.

    Raises:
        InputError: It is not; the message names the shape and the parameter.
    """
    try:
        tensor = torch.as_tensor(value)
        tensor = tensor if tensor.is_floating_point() else tensor.to(torch.get_default_dtype())
        valid = tuple(tensor.shape) == shape and bool(torch.isfinite(tensor.float()).all() and (tensor > 0).all())
    except (TypeError, ValueError, RuntimeError, OverflowError):
        valid = False
    if not valid:
        expected = "a positive number" if shape == () else f"{shape[0]} positive numbers"
        given = value.tolist() if isinstance(value, Tensor) else value
        raise InputError(f"{shape_name}: {name} is {given!r}, but must be {expected} of meters")
    return tensor
