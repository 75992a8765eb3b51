"""The task `surfsup/Pour-v0`: tilt a cup so that a part of its water is in a glass, and spill nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from surfsup.scene import Scene
from surfsup.simulation import Simulation
from surfsup.simulation_state import SimulationState

RADIUS, INNER_RADIUS, HEIGHT, FLOOR = 0.09, 0.075, 0.2, 0.015  # of cup and glass, meters
GLASS_PLACE, CUP_PLACE = 0.13, -0.05  # x of the middles at the start, meters
CUP_HEIGHT = 0.24  # of the bottom of the cup
WATER_HEIGHT = 0.14  # in the cup, above its bottom
ACTION_TIME = 0.04  # seconds of an action
TILT_RATE, SPEED = 2.0, 0.3  # rad/s and m/s of the action 1
MAX_TILT, MAX_SHIFT = math.radians(150), 0.15  # the shift is along x, meters
SPILL_COST = 2.0  # a spilled share costs this many times what a missing share costs
TARGETS = (0.3, 0.9)  # shares of the water

VESSEL = f"""
    difference:
      - cylinder: {{radius: {RADIUS}, height: {HEIGHT}}}
        at: [0, 0, {HEIGHT / 2}]
      - cylinder: {{radius: {INNER_RADIUS}, height: 1}}
        at: [0, 0, {FLOOR + 0.5}]
"""
SCENE = f"""
container: {{size: [0.7, 0.4, 0.7]}}
particle_radius: 0.0075
surfaces:
  glass: {VESSEL}
    at: [{GLASS_PLACE}, 0, 0]
  cup: {VESSEL}
    at: [{CUP_PLACE}, 0, {CUP_HEIGHT}]
    motion: {{keyframes: [{{time: 0}}]}}
fluid:
  - fill: {{below: {CUP_HEIGHT + WATER_HEIGHT}, seed: [{CUP_PLACE}, 0, {CUP_HEIGHT + 0.05}], settle: true}}
"""


@dataclass(frozen=True)
class Shares:
    """Where the water is; the shares add up to 1.

    Attributes:
        cup, glass: in the vessels.
        spilled: outside, below the rim of the glass.
        air: the rest.
    """

    cup: float
    glass: float
    spilled: float
    air: float


class Pour(gymnasium.Env[np.ndarray, np.ndarray]):
    """Tilt a cup so that a given share of its water is in a glass at the end, and spill nothing.

    **Action** (2,) in [-1, 1]: tilting rate, 1 is 2 rad/s toward the glass; speed along x, 1 is 0.3 m/s.

    **Observation** (8,) float32: tilt / 150°, shift of the cup / 0.15 m, shares of the water in cup, glass, air and
    spilled, the target share, and the mean speed of the water in m/s / 5, all within [-1, 1].

    **Reward**: the decrease of ``|target - glass| + 2 spilled`` in a step. So an episode's sum is at most the target.

    An episode is 100 actions of 40 ms. It ends early only if the simulation fails. ``reset(seed)`` draws the target
    between 0.3 and 0.9; ``reset(options={"target": 0.5})`` sets it.

    Args:
        render_mode: ``rgb_array`` for pictures of 480 x 360, or None.

    Examples:
        >>> import gymnasium, surfsup.gym
        >>> environment = gymnasium.make("surfsup/Pour-v0")
        >>> observation, info = environment.reset(seed=0)
        >>> observation.shape, info["shares"].cup
        ((8,), 1.0)
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": round(1 / ACTION_TIME)}  # noqa: RUF012  gymnasium's name

    def __init__(self, render_mode: str | None = None) -> None:
        self.render_mode = render_mode
        self.action_space = spaces.Box(-1, 1, (2,), np.float32)
        self.observation_space = spaces.Box(-1, 1, (8,), np.float32)
        self.simulation = Simulation(Scene.from_yaml(SCENE, "Pour-v0"), device="cpu")
        self.simulation.set_pose("cup", *self._place(0.0, 0.0))
        self._steps = round(ACTION_TIME / self.simulation.scene.units.frame_time)
        self._tilt = self._shift = 0.0
        self._target, self._cost = 0.5, 0.0
        self._pictures: Pictures | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Return the cup to its start, full, and draw a target share."""
        super().reset(seed=seed)
        drawn = float(self.np_random.uniform(*TARGETS))
        self._target = float((options or {}).get("target", drawn))
        self._tilt = self._shift = 0.0
        self.simulation.set_pose("cup", *self._place(0.0, 0.0))
        self.simulation.reset()
        shares = self.shares()
        self._cost = self._cost_of(shares)
        return self._observation(shares), self._info(shares)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Move the cup for 40 ms."""
        rate, speed = np.clip(np.asarray(action, np.float64), -1, 1)
        before = self._tilt, self._shift
        self._tilt = min(MAX_TILT, max(0.0, self._tilt + float(rate) * TILT_RATE * ACTION_TIME))
        self._shift = min(MAX_SHIFT, max(-MAX_SHIFT, self._shift + float(speed) * SPEED * ACTION_TIME))
        for number in range(1, self._steps + 1):
            part = number / self._steps
            tilt, shift = (old + part * (new - old) for old, new in zip(before, (self._tilt, self._shift), strict=True))
            self.simulation.set_pose("cup", *self._place(tilt, shift))
            self.simulation.step()
        shares = self.shares()
        before_cost, self._cost = self._cost, self._cost_of(shares)
        return self._observation(shares), before_cost - self._cost, False, False, self._info(shares)

    def shares(self) -> Shares:
        """Where the water is now."""
        frame = self.simulation.frame
        in_cup = inside_vessel(frame.poses["cup"].to_own(frame.positions))
        in_glass = inside_vessel(frame.positions - [GLASS_PLACE, 0, 0]) & ~in_cup
        spilled = ~in_cup & ~in_glass & (frame.positions[:, 2] < HEIGHT)
        cup, glass, lost = (float(places.mean()) for places in (in_cup, in_glass, spilled))
        return Shares(cup, glass, lost, max(0.0, 1 - cup - glass - lost))

    def render(self) -> np.ndarray | None:
        """The present picture (360, 480, 3) uint8 in the mode ``rgb_array``.

        Raises:
            InputError: this machine cannot render off screen.
        """
        if self.render_mode is None:
            return None
        if self._pictures is None:
            self._pictures = Pictures(self.simulation)
        return self._pictures.draw(self.simulation)

    def close(self) -> None:
        """Free the window of the pictures."""
        if self._pictures is not None:
            self._pictures.close()
            self._pictures = None

    @property
    def state(self) -> tuple[SimulationState, float, float, float]:
        """All that :meth:`set_state` needs: the water, tilt in rad, shift in meters, and the target share."""
        return self.simulation.state, self._tilt, self._shift, self._target

    def set_state(self, state: tuple[SimulationState, float, float, float]) -> None:
        """Return to a :attr:`state`, for planning."""
        fluid, self._tilt, self._shift, self._target = state
        self.simulation.reset(fluid)
        self._cost = self._cost_of(self.shares())

    def _place(self, tilt: float, shift: float) -> tuple[list[float], list[float]]:
        """Position and rotation of the cup, which turns about the middle of its height."""
        half = HEIGHT / 2
        x = CUP_PLACE + shift - half * math.sin(tilt)
        z = CUP_HEIGHT + half - half * math.cos(tilt)
        return [x, 0.0, z], [math.cos(tilt / 2), 0.0, math.sin(tilt / 2), 0.0]

    def _cost_of(self, shares: Shares) -> float:
        return abs(self._target - shares.glass) + SPILL_COST * shares.spilled

    def _observation(self, shares: Shares) -> np.ndarray:
        speed = float(np.linalg.norm(self.simulation.frame.velocities, axis=1).mean())
        values = [
            self._tilt / MAX_TILT, self._shift / MAX_SHIFT,
            shares.cup, shares.glass, shares.air, shares.spilled, self._target, speed / 5,
        ]  # fmt: skip
        return np.clip(np.array(values, np.float32), -1, 1)

    def _info(self, shares: Shares) -> dict[str, Any]:
        return {"shares": shares, "target": self._target, "time": self.simulation.time}


def inside_vessel(points: np.ndarray) -> np.ndarray:
    """Whether ``points`` (N, 3) in the frame of a vessel are in its inside (N,)."""
    radial = np.hypot(points[:, 0], points[:, 1])
    return (radial < INNER_RADIUS) & (points[:, 2] > 0) & (points[:, 2] < HEIGHT)


class Pictures:
    """Draws a simulation whose cup moves.

    Args:
        simulation: whose solids and container to draw.

    Raises:
        InputError: this machine cannot render off screen.
    """

    SIZE = (480, 360)  # pixels

    def __init__(self, simulation: Simulation) -> None:
        from surfsup.viewing.renderer import FrameRenderer

        solids = simulation.motion.solids
        assert solids.still is not None  # the glass
        self._still = solids.still.to_mesh(96)
        self._moving = [(solid.name, solid.surface.to_mesh(96)) for solid in solids.moving]
        self._size = simulation.scene.container.size
        bounds = np.array([[-0.3, -0.1, 0], [0.25, 0.1, 0.5]])
        self._renderer = FrameRenderer(None, self._size, simulation.scene.particle_radius, None, self.SIZE, bounds)

    def draw(self, simulation: Simulation) -> np.ndarray:
        """The picture (height, width, 3) uint8 of the present frame."""
        from surfsup.viewing.moving_mesh import MovingMesh, at_frame, container_corners

        frame = simulation.frame
        moving = [MovingMesh(mesh, frame.poses[name].array[None]) for name, mesh in self._moving]
        self._renderer.set_solid(at_frame(self._still, moving, 0), container_corners(self._size, {}, 0))
        return self._renderer.render(frame.positions)

    def close(self) -> None:
        """Free the off-screen window."""
        self._renderer.close()
