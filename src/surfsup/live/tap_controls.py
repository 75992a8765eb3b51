"""The tap of a live page: a nozzle that is dragged to its place, its opening and its flow."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from surfsup.live.liquid_choice import liquid_choice
from surfsup.live.world import LiveWorld

if TYPE_CHECKING:
    import viser

Command = Callable[[LiveWorld], str | None]  # what it did, for the page; None says nothing

CLOSED_COLOR, OPEN_COLOR = (150, 155, 160), (60, 150, 215)
# With particles of 15 mm: radii of the opening in meters, and flows in liters a second.
OPENINGS, OPENING = (0.03, 0.15), 0.05
FLOWS, FLOW = (0.5, 20.0), 4.0
ABOVE = 0.25  # meters above the solid, where there is room
NOZZLE = 0.1  # meters, length


class TapControls:
    """Sliders and a nozzle in the scene.

    Args:
        server: of viser.
        world: the water.
        send: has a command done with the world.
    """

    def __init__(self, server: viser.ViserServer, world: LiveWorld, send: Callable[[Command], None]) -> None:
        gui, scale = server.gui, world.scene.units.length
        flow_scale = scale**2.5  # an area times a speed
        self._opening = gui.add_slider("opening, m", *rounded(OPENINGS, scale), 0.001 * scale, OPENING * scale)
        self._flow = gui.add_slider("flow, l/s", *rounded(FLOWS, flow_scale), 0.1 * flow_scale, FLOW * flow_scale)
        self._liquid = liquid_choice(server, world)
        self._place = gui.add_vector3("nozzle, m", above_solid(world, scale), step=0.01)
        handle = server.scene.add_transform_controls(
            "tap", 0.15 * scale, disable_rotations=True, position=self._place.value, depth_test=False
        )
        self._nozzle = server.scene.add_cylinder(
            "tap/nozzle", self._opening.value, NOZZLE * scale, CLOSED_COLOR, position=(0, 0, NOZZLE * scale / 2)
        )
        self._button = gui.add_button("Open tap")
        self._button.on_click(lambda _: send(self._toggle))
        self._place.on_update(lambda _: setattr(handle, "position", self._place.value))
        handle.on_update(lambda _: setattr(self._place, "value", tuple(round(float(c), 3) for c in handle.position)))
        self._opening.on_update(lambda _: setattr(self._nozzle, "radius", self._opening.value))
        for control in (self._place, handle, self._opening, self._flow):
            control.on_update(lambda _: send(self._change))

    def show(self, world: LiveWorld) -> None:
        """Show whether the tap is open."""
        is_open = world.tap is not None
        self._button.label = "Close tap" if is_open else "Open tap"
        self._nozzle.color = OPEN_COLOR if is_open else CLOSED_COLOR

    def _toggle(self, world: LiveWorld) -> str:
        if world.tap is not None:
            world.close_tap()
            return "the tap is closed"
        self._open(world)
        return f"the tap is open: {self._flow.value:g} liters a second"

    def _change(self, world: LiveWorld) -> None:
        if world.tap is not None:
            self._open(world)

    def _open(self, world: LiveWorld) -> None:
        world.open_tap(self._place.value, self._opening.value, self._flow.value, self._liquid())


def rounded(values: tuple[float, float], scale: float) -> tuple[float, float]:
    """Both values times a scale, with three digits."""
    lower, upper = (float(f"{scale * value:.3g}") for value in values)
    return lower, upper


def above_solid(world: LiveWorld, scale: float) -> tuple[float, float, float]:
    """A place above the middle of the solids, or of the container if there are none, meters."""
    x, y, z = 0.0, 0.0, 0.0
    solid = world.simulation.motion.solids.at(world.frame.poses)
    if solid is not None:
        lower, upper = solid.bounds().tolist()
        x, y, z = (lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2, upper[2]
    z = min(z + ABOVE * scale, 0.9 * world.scene.container.size[2])
    return round(x, 2), round(y, 2), round(z, 2)
