"""The live page in the browser, by viser: what it shows, and its buttons and sliders."""

from __future__ import annotations

import html
from collections.abc import Callable
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

import numpy as np

from surfsup.live.drawn_water import PARTICLES, SURFACE, DrawnWater
from surfsup.live.liquid_choice import liquid_choice
from surfsup.live.tap_controls import Command, TapControls
from surfsup.live.world import LiveWorld
from surfsup.scene import quaternion
from surfsup.scene.pose import Pose
from surfsup.scene.solids import CONTAINER
from surfsup.simulation_state import Frame
from surfsup.viewing.camera import FIELD_OF_VIEW, fit_camera
from surfsup.viewing.moving_mesh import container_corners

if TYPE_CHECKING:
    import viser

SOLID_COLOR, EDGE_COLOR = (205, 125, 80), (90, 100, 110)
AMBIENT = 0.9
SOLID_RESOLUTION = 96  # cells of marching cubes
VISCOSITIES = {"as the scene has it": None, **{f"{value:g}": value for value in (0.03, 0.1, 0.3, 1.0)}}
RADII = {f"{radius}": radius / 1000 for radius in (10, 12, 15, 20, 25)}


class LivePage:
    """The page.

    Args:
        server: of viser.
        world: the water.

    Attributes:
        commands: what the buttons and sliders want done with the world, in order; the loop of the simulation does it,
            because the world belongs to one thread.
        paused: whether time stands still.
    """

    def __init__(self, server: viser.ViserServer, world: LiveWorld) -> None:
        self._server = server
        self.commands: SimpleQueue[Command] = SimpleQueue()
        self.paused = False
        self._solids: dict[str, Any] = {}
        self._water = DrawnWater(server, world.scene)
        self._draw_scene(world)
        self._add_controls(world)
        self.show(world.frame, world)

    # ---- what is seen

    def _draw_scene(self, world: LiveWorld) -> None:
        scene = self._server.scene
        scene.set_up_direction("+z")
        # Without a GPU a picture takes 0.25 s of the processor with these lights, 1.9 s with viser's own (measured).
        scene.configure_environment_map(None)
        scene.configure_default_lights(cast_shadow=False)
        scene.add_light_ambient("light", color=(255, 255, 255), intensity=AMBIENT)
        scene.add_grid(
            "floor", 4.0, 4.0, plane="xy", cell_size=0.1, section_size=1.0, cell_color=(225, 228, 231),
            section_color=(205, 210, 215), plane_color=(246, 247, 248), plane_opacity=1.0, position=(0, 0, -0.002),
        )  # fmt: skip
        size = world.scene.container.size
        if not world.scene.container.open:
            corners = container_corners(size, {}, 0)
            pairs = [(i, (i + 1) % 4) for i in range(4)]
            pairs += [(a + 4, b + 4) for a, b in pairs] + [(i, i + 4) for i in range(4)]
            self._solids[CONTAINER] = scene.add_line_segments(
                "container", np.array([[corners[a], corners[b]] for a, b in pairs]), EDGE_COLOR, thickness=0.003
            )
        solids = world.simulation.motion.solids
        if solids.still is not None:
            mesh = solids.still.to_mesh(SOLID_RESOLUTION)
            scene.add_mesh_simple("still", np.asarray(mesh.vertices), np.asarray(mesh.faces), color=SOLID_COLOR)
        for solid in solids.moving:
            mesh = solid.surface.to_mesh(SOLID_RESOLUTION)
            self._solids[solid.name] = scene.add_mesh_simple(
                f"solids/{solid.name}", np.asarray(mesh.vertices), np.asarray(mesh.faces), color=SOLID_COLOR
            )
        camera = fit_camera(size, None, world.frame.positions, (1000, 800))
        view = self._server.initial_camera
        view.position, view.look_at = tuple(camera.eye), tuple(camera.target)
        view.fov = float(np.radians(FIELD_OF_VIEW))

    def show(self, frame: Frame, world: LiveWorld) -> bool:
        """Draw the water and the solids of a frame; returns whether water, or an earlier surface, was drawn."""
        with self._server.atomic():
            for name, pose in frame.poses.items():
                if name in self._solids:
                    handle = self._solids[name]
                    handle.position, handle.wxyz = tuple(pose.position), tuple(pose.rotation)
            return self._water.show(frame, self._style.value, world.scene.particle_radius)

    def update(self) -> bool:
        """Draw what was made meanwhile; returns whether there was something."""
        with self._server.atomic():
            return self._water.update()

    def report(self, text: str) -> None:
        """Show what happened."""
        self._message.content = html.escape(text)

    def show_rates(self, world: LiveWorld, pictures: float, speed: float) -> None:
        """Show the measured rates, and whether the tap is open."""
        recording = f"<br>recording to {html.escape(str(world.recording))}" if world.recording else ""
        state = "paused" if self.paused else f"{pictures:.0f} frames per second, {speed:.2f} of real time"
        self._tap.show(world)
        self._rates.content = (
            f"<b>{state}</b><br>{len(world.frame.positions):,} particles, {world.simulation.time:.2f} s{recording}"
        )

    # ---- buttons and sliders

    def _add_controls(self, world: LiveWorld) -> None:
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, dark_mode=False)
        gui.main_panel.dock_right()
        gui.set_panel_label("surfsup")
        self._rates = gui.add_markdown("")
        self._message = gui.add_markdown("")
        self._pause = gui.add_button("Pause")
        self._pause.on_click(lambda _: self._toggle_pause())
        self._button("Step", lambda world: self._step(world))
        self._button("Reset", lambda world: self._reset(world))
        self._record = self._button("Record", lambda world: self._toggle_recording(world))
        self._style = gui.add_dropdown("Draw", (PARTICLES, SURFACE), initial_value=PARTICLES)
        with gui.add_folder("Pour"):
            self._add_pouring(world)
        with gui.add_folder("Tap"):
            self._tap = TapControls(self._server, world, self._send)
        with gui.add_folder("Gravity"):
            self._tilts: list[Any] = [gui.add_slider(f"tilt {axis}, °", -90.0, 90.0, 1.0, 0.0) for axis in "xy"]
            for tilt in self._tilts:
                tilt.on_update(lambda _: self._send_gravity())
        if world.movable:
            with gui.add_folder("Solid"):
                self._add_moving(world)
        with gui.add_folder("Particles"):
            label = f"{1000 * world.scene.particle_radius:g}"
            sizes = RADII if label in RADII else {label: world.scene.particle_radius, **RADII}
            radius = gui.add_dropdown("radius, mm", tuple(sizes), initial_value=label)
            radius.on_update(lambda _: self._send(lambda world: self._restart(world, sizes[radius.value])))
            self._viscosity: Any = None
            if not world.scene.mixture:  # whose viscosities stay
                self._viscosity = gui.add_dropdown("viscosity, m²/s", tuple(VISCOSITIES))
                self._viscosity.on_update(lambda _: self._send(self._set_viscosity))

    def _button(self, label: str, command: Command) -> Any:
        button = self._server.gui.add_button(label)
        button.on_click(lambda _: self._send(command))
        return button

    def _send(self, command: Command) -> None:
        self.commands.put(command)

    def _toggle_pause(self) -> None:
        self.paused = not self.paused
        self._pause.label = "Resume" if self.paused else "Pause"

    def _step(self, world: LiveWorld) -> str | None:
        if not self.paused:
            self._toggle_pause()
        self.show(world.step(), world)
        return None

    def _reset(self, world: LiveWorld) -> str:
        world.reset()
        for tilt in self._tilts:
            tilt.value = 0.0
        if self._viscosity is not None:
            self._viscosity.value = next(iter(VISCOSITIES))
        self._show_start(world)
        return "back at the start"

    def _set_viscosity(self, world: LiveWorld) -> None:
        if self._viscosity is None:
            return
        chosen = VISCOSITIES[self._viscosity.value]
        own = None if world.scene.liquid is None else world.scene.liquid.viscosity
        world.set_viscosity(own if chosen is None else chosen)

    def _restart(self, world: LiveWorld, radius: float) -> str:
        world.set_particle_radius(radius)
        self._set_viscosity(world)
        self._show_start(world)
        return f"{len(world.frame.positions):,} particles of {1000 * radius:g} mm"

    def _show_start(self, world: LiveWorld) -> None:
        for name in world.movable:
            self._handles[name].place(world.frame.poses[name])
        self.show(world.frame, world)

    def _toggle_recording(self, world: LiveWorld) -> str:
        if world.recording is None:
            path = world.start_recording()
            self._record.label = "Stop recording"
            return f"recording to {path}"
        written = world.stop_recording()
        self._record.label = "Record"
        return f"recorded {written}"

    def recording_ended(self) -> None:
        """Show that nothing is recorded any more, after a command that ended it."""
        self._record.label = "Record"

    def _add_pouring(self, world: LiveWorld) -> None:
        gui, (x, y, z) = self._server.gui, world.scene.container.size
        side = gui.add_slider("side, m", 0.05, 0.6, 0.01, min(0.25, 0.4 * min(x, y)))
        height = gui.add_slider("height, m", 0.05, 1.0, 0.01, 0.25)
        place = gui.add_vector3("place, m", (0.0, 0.0, round(0.7 * z, 2)), step=0.01)
        liquid = liquid_choice(self._server, world)
        handle = self._server.scene.add_transform_controls(
            "pour", 0.15, disable_rotations=True, position=place.value, depth_test=False
        )
        place.on_update(lambda _: setattr(handle, "position", place.value))
        handle.on_update(lambda _: setattr(place, "value", tuple(round(float(c), 3) for c in handle.position)))

        def pour(world: LiveWorld) -> str:
            added = world.pour(place.value, (side.value, side.value, height.value), liquid())
            return f"{added:,} particles poured" if added else "no room there: solid, walls or water"

        self._button("Pour", pour)

    def _send_gravity(self) -> None:
        tilt = np.radians([slider.value for slider in self._tilts])

        def tilted(world: LiveWorld) -> None:
            world.set_gravity(tilted_gravity(world.scene.gravity, tilt[0], tilt[1]))

        self._send(tilted)

    def _add_moving(self, world: LiveWorld) -> None:
        gui = self._server.gui
        name = gui.add_dropdown("solid", tuple(world.movable), initial_value=world.movable[0])
        self._handles = {
            each: SolidHandle(self._server, each, world.frame.poses[each], self._send) for each in world.movable
        }
        show = gui.add_checkbox("handles", False, hint="arrows and rings at the solid, to drag it")

        def show_handles(_: object) -> None:
            for each, handle in self._handles.items():
                handle.visible = show.value and each == name.value

        for control in (show, name):
            control.on_update(show_handles)

        def moved_by(offset: tuple[float, float, float], degrees: float) -> Callable[[object], None]:
            return lambda _: self._handles[name.value].nudge(offset, degrees)

        group = gui.add_button_group("move 5 cm", ("left", "right", "up", "down"))
        offsets = {"left": (-0.05, 0, 0), "right": (0.05, 0, 0), "up": (0, 0, 0.05), "down": (0, 0, -0.05)}
        group.on_click(lambda event: moved_by(offsets[event.target.value], 0.0)(event))
        turns = gui.add_button_group("turn", ("-15°", "+15°"))
        turns.on_click(lambda event: moved_by((0, 0, 0), 15.0 if event.target.value == "+15°" else -15.0)(event))


class SolidHandle:
    """Arrows and rings that move one solid."""

    def __init__(self, server: viser.ViserServer, name: str, pose: Pose, send: Callable[[Command], None]) -> None:
        self._name, self._send = name, send
        self._controls = server.scene.add_transform_controls(
            f"handles/{name}", 0.3, position=tuple(pose.position), wxyz=tuple(pose.rotation), visible=False,
            depth_test=False,
        )  # fmt: skip
        self._controls.on_update(lambda _: self._moved())

    @property
    def visible(self) -> bool:
        """Whether the arrows and rings are shown."""
        return bool(self._controls.visible)

    @visible.setter
    def visible(self, value: bool) -> None:
        self._controls.visible = value

    def place(self, pose: Pose) -> None:
        """Show the handle at a pose."""
        self._controls.position, self._controls.wxyz = tuple(pose.position), tuple(pose.rotation)

    def nudge(self, offset: tuple[float, float, float], degrees: float) -> None:
        """Move the solid by an ``offset`` in meters, and turn it about z."""
        turn = quaternion.about_axis((0, 0, 1), np.radians(degrees))
        position = np.asarray(self._controls.position) + offset
        self.place(Pose.of(position, quaternion.product(turn, np.asarray(self._controls.wxyz))))
        self._moved()

    def _moved(self) -> None:
        pose = Pose.of(np.asarray(self._controls.position), np.asarray(self._controls.wxyz))
        self._send(lambda world: world.move(self._name, pose))


def tilted_gravity(gravity: tuple[float, float, float], about_x: float, about_y: float) -> tuple[float, float, float]:
    """Gravity in m/s² after a turn about x, then about y, in radians."""
    turn = quaternion.product(quaternion.about_axis((0, 1, 0), about_y), quaternion.about_axis((1, 0, 0), about_x))
    x, y, z = (quaternion.matrix(turn) @ gravity).tolist()
    return x, y, z
