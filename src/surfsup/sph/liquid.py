"""Viscosity, surface tension and adhesion of a liquid, in the units of the solver.

**Viscosity** is implicit: a substep solves (1 + Δt B − Δt L) v' = v + Δt B v_solid for the velocities v' by conjugate
gradients, with the Laplacian of Monaghan as a sum over pairs,

    (L v)ᵢ = 10 ν Σⱼ V / (Dᵢ Dⱼ) ((vᵢ − vⱼ) · (xᵢ − xⱼ)) / (|xᵢ − xⱼ|² + 0.01 h²) ∇W

(M. Weiler, D. Koschier, M. Brand, J. Bender, "A Physically Consistent Implicit Viscosity Solver for SPH Fluids",
Computer Graphics Forum 37, 2018). Its pair forces are central and equal and opposite, so momentum and angular momentum
are conserved. Friction B at a solid is the same sum over the solid, whose volume the reference has at four points half
a kernel support aside from the nearest one.

**Surface tension** has cohesion and differences of surface normals n,

    aᵢ = − γ Σⱼ 2 / (Dᵢ + Dⱼ) (m C(|xᵢ − xⱼ|) (xᵢ − xⱼ) / |xᵢ − xⱼ| + nᵢ − nⱼ),  nᵢ = h Σⱼ V / Dⱼ ∇W

and **adhesion** pulls towards a solid with the kernel A of the same authors (N. Akinci, G. Akinci, M. Teschner,
"Versatile Surface Tension and Adhesion for SPH Fluids", ACM Transactions on Graphics 32, 2013). The factors that
turn N/m into their coefficients are measured (``benchmarks/physics_of_liquids.py``).

**Liquids that do not mix** differ in the mass of their particles, not in their volume: densities relative to the rest
density are sums of volumes V W, whatever the masses of the neighbors, so a boundary between two liquids is as sharp as
the particles (B. Solenthaler, R. Pajarola, "Density Contrast SPH Interfaces", Symposium on Computer Animation 2008).
A pressure acts on both particles of a pair with the same force, which changes the velocity of the lighter one more.
Viscosity acts between two liquids with the harmonic mean of their dynamic viscosities, tension within each alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from torch import Tensor

from surfsup import native
from surfsup.scene import Scene
from surfsup.scene.liquid import Liquid
from surfsup.sph.boundary.density import VOLUME_FACTOR
from surfsup.sph.dfsph import LAPLACIAN_FACTOR, VISCOSITY

REST_DENSITY = 1000.0  # kg/m³, of the solver and the reference
TENSION_OF_COEFFICIENT = 57.0  # N/m of surface tension that a coefficient γ of 1 gives at the rest density
ADHESION_OF_COEFFICIENT = (
    2.2  # N/m that a coefficient β of 1 gives, by integrating its force on the first layer at a plane
)
VISCOSITY_FACTOR = 1.35  # of the Laplacian, which sees too few neighbors: with it the flow in a duct is right
NO_SLIP = 5.0  # coefficient at solids over that of the liquid, with which the liquid is at rest at their surface
TOLERANCE = 1e-4  # m/s, a hundredth of what gravity adds in a substep
MAX_ITERATIONS = 100  # of a substep, the reference's
COHESION = 32 / math.pi / 8  # of the kernel C, times V / h³
ADHESION = 0.007 * 4 / 3 * math.pi * VOLUME_FACTOR  # of the kernel A, times the solid's volume over h³


@dataclass(frozen=True)
class LiquidForces:
    """The coefficients of a liquid in the units of the solver, as the reference has them.

    Attributes:
        viscosity: of Weiler et al., m²/s; None for the explicit one of the solver.
        boundary_viscosity: at solids, m²/s.
        surface_tension: Akinci's γ.
        adhesion: Akinci's β.
    """

    viscosity: float | None
    boundary_viscosity: float
    surface_tension: float
    adhesion: float

    @classmethod
    def of(cls, liquid: Liquid | None) -> LiquidForces | None:
        """Those of a liquid in the units of the solver; None where it is the solver's own water."""
        if liquid is None:
            return None
        per_density = REST_DENSITY / liquid.density
        viscosity = None if liquid.viscosity is None else VISCOSITY_FACTOR * liquid.viscosity
        forces = cls(
            viscosity,
            NO_SLIP * liquid.friction * (viscosity or 0.0),
            liquid.surface_tension * per_density / TENSION_OF_COEFFICIENT,
            liquid.adhesion * per_density / ADHESION_OF_COEFFICIENT,
        )
        return None if forces == cls(None, 0.0, 0.0, 0.0) else forces

    @classmethod
    def of_scene(cls, scene: Scene) -> LiquidForces | Mixture | None:
        """Those of a scene in the units of the solver."""
        return Mixture.of(scene.mixture, scene.density) if scene.mixture else cls.of(scene.liquid)

    @property
    def coefficients(self) -> dict[str, float]:
        """The coefficients as the solver uses them, see ``native/sph/liquid.hpp``."""
        return {
            "viscosity": LAPLACIAN_FACTOR * (VISCOSITY if self.viscosity is None else self.viscosity),
            "friction": LAPLACIAN_FACTOR * self.boundary_viscosity,
            "cohesion": REST_DENSITY * COHESION * self.surface_tension,
            "curvature": self.surface_tension,
            "adhesion": REST_DENSITY * ADHESION * self.adhesion,
        }

    def parameters(self, mass: float) -> native.LiquidParameters:
        """The coefficients for C++ code, for particles of a mass in units of that of one of the scene's density."""
        parameters = native.LiquidParameters()
        parameters.mass = mass
        parameters.implicit_viscosity = self.viscosity is not None
        for name, value in self.coefficients.items():
            setattr(parameters, name, value)
        parameters.tolerance = TOLERANCE
        parameters.max_iterations = MAX_ITERATIONS
        return parameters

    @cached_property
    def native(self) -> list[native.LiquidParameters]:
        """The coefficients for C++ code, the only entry of a list."""
        return [self.parameters(1.0)]

    def __getstate__(self) -> dict[str, object]:
        """The fields alone: cached native objects can be neither copied nor pickled."""
        return without_native(self)


@dataclass(frozen=True)
class Mixture:
    """Liquids that do not mix, in the units of the solver.

    Attributes:
        forces: coefficients of each, all with an implicit viscosity.
        masses: of a particle of each, in units of that of a particle of the scene's density.
    """

    forces: tuple[LiquidForces, ...]
    masses: tuple[float, ...]

    @classmethod
    def of(cls, liquids: Sequence[Liquid], density: float) -> Mixture:
        """Liquids in a scene of a ``density`` in kg/m³."""
        water = LiquidForces(VISCOSITY, 0.0, 0.0, 0.0)
        forces = [LiquidForces.of(liquid) or water for liquid in liquids]
        viscous = (each if each.viscosity is not None else replace(each, viscosity=VISCOSITY) for each in forces)
        return cls(tuple(viscous), tuple(liquid.density / density for liquid in liquids))

    @cached_property
    def native(self) -> list[native.LiquidParameters]:
        """The coefficients of each for C++ code."""
        return [each.parameters(mass) for each, mass in zip(self.forces, self.masses, strict=True)]

    def masses_of(self, liquids: Tensor) -> np.ndarray:
        """The mass (N,) float32 of each particle, from the number of its liquid (N,)."""
        return np.asarray(self.masses, np.float32)[liquids.numpy()]

    def __getstate__(self) -> dict[str, object]:
        """The fields alone: cached native objects can be neither copied nor pickled."""
        return without_native(self)


def without_native(forces: LiquidForces | Mixture) -> dict[str, object]:
    """The attributes of an object but its cached native ones."""
    return {name: value for name, value in vars(forces).items() if name != "native"}
