"""The undamaged inputs that the campaign damages: small, and made by surfsup itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import trimesh

from fault_campaign.program import surfsup

LENGTH = 0.015  # meters, the particle radius of the simulators
SCENE = """\
container: {size: [0.6, 0.6, 0.9]}
surface: {sphere: {radius: 0.1}, at: [0, 0, 0.15]}
fluid:
  - block: {min: [-0.1, -0.1, 0.4], max: [0.1, 0.1, 0.58]}
frames: 24
"""
TRAINING = ("kind=surfsup", "width=4", "layers=1", "steps=4", "batch=1", "validate_every=2", "validation_scenes=1")
SHORT = (*TRAINING, "validation_frames=2", "warm_up=1")
QUIET = ("--no-page", "--no-video")


@dataclass(frozen=True)
class Inputs:
    """Files in one folder.

    Attributes:
        folder: of all.
        scene, mesh: text files.
        trajectory, weights, siren, checkpoint, fit: binary ones; the last two are the checkpoints of a training and of
            a fit.
        data: a folder of two trajectories.
        generated: a data set of two scenes, as `surfsup generate` makes it.
        data_folder: name of the folder of ``data``.
    """

    folder: Path
    data_folder: str = "data"

    @property
    def scene(self) -> Path:
        return self.folder / "scene.yaml"

    @property
    def mesh(self) -> Path:
        return self.folder / "ball.stl"

    @property
    def data(self) -> Path:
        return self.folder / self.data_folder

    @property
    def trajectory(self) -> Path:
        return self.data / "00000.h5"

    @property
    def generated(self) -> Path:
        return self.folder / "generated"

    @property
    def run(self) -> Path:
        return self.folder / "run"

    @property
    def checkpoint(self) -> Path:
        return self.run / "checkpoint.safetensors"

    @property
    def weights(self) -> Path:
        return self.run / "best.safetensors"

    @property
    def siren(self) -> Path:
        return self.folder / "siren.safetensors"

    @property
    def fit(self) -> Path:
        return self.folder / "siren.fit" / "checkpoint.safetensors"


def train_arguments(inputs: Inputs, out: Path | str) -> list[object]:
    """A training of a second."""
    return ["train", "surfsup", "--data", inputs.data, "--validation", inputs.data, "-o", out, *SHORT]


def generate_arguments(out: Path | str, scenes: int) -> list[object]:
    """A data set of a few seconds."""
    return ["generate", "prim-shapes", "-o", out, "-n", scenes, "--frames", 20, "--workers", 1]


def fit_arguments(inputs: Inputs, out: Path | str) -> list[object]:
    """A fit of a second."""
    return [
        "fit",
        "siren",
        inputs.mesh,
        "-o",
        out,
        "width=8",
        "layers=1",
        "steps=60",
        "samples=1000",
        "batch=64",
        "validate_every=30",
    ]


def make_inputs(folder: Path, light: bool = False) -> Inputs:
    """Make them all, or if ``light`` only those that take no training.

    Raises:
        RuntimeError: surfsup fails at something undamaged.
    """
    inputs = Inputs(folder)
    inputs.data.mkdir(parents=True)
    inputs.scene.write_text(SCENE)
    recorded = folder / "recorded.yaml"
    recorded.write_text(f"{SCENE}forces: all\n")  # of which no learned simulator knows
    trimesh.creation.icosphere(2, 0.3).export(inputs.mesh)
    for number in range(2):
        made("simulate", recorded, "-o", folder / f"out{number}", *QUIET)
        (folder / f"out{number}" / "trajectory.h5").rename(inputs.data / f"{number:05d}.h5")
    if light:
        return inputs
    made(*train_arguments(inputs, inputs.run))
    made(*fit_arguments(inputs, inputs.siren))
    made(*generate_arguments(inputs.generated, 2))
    return inputs


def without_graphics() -> None:
    """A machine without OpenGL, which saves a training the pictures of its rollouts."""
    from surfsup.viewing import graphics

    def no_library(name: str) -> None:
        raise OSError(name)

    graphics._open_library = no_library


def made(*arguments: object) -> None:
    """Run surfsup, which must succeed."""
    done = surfsup(arguments, Path("/"), without_graphics, limit=300)
    if done.status:
        raise RuntimeError(f"surfsup {' '.join(map(str, arguments))} failed: {done.errors.strip()}")
