"""Trajectories in notebooks: the interactive page inside a cell."""

from __future__ import annotations

import html
import tempfile
from dataclasses import dataclass
from pathlib import Path

from surfsup.viewing.trajectory_page import write_trajectory_page


@dataclass(frozen=True)
class Player:
    """The page that plays a trajectory; a notebook shows it as the value of a cell.

    Attributes:
        page: HTML that needs no network.
        height: of the frame in the notebook, pixels.
    """

    page: str
    height: int

    def _repr_html_(self) -> str:
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe srcdoc="{html.escape(self.page)}" style="{style}"></iframe>'

    def __repr__(self) -> str:
        return f"Player of {len(self.page) / 1000:.0f} kB"


def show(trajectory: str | Path, height: int = 480) -> Player:
    """The interactive page of a trajectory, to be the value of a notebook's cell.

    Args:
        trajectory: the file.
        height: of the frame in the notebook, pixels.

    Raises:
        InputError: the file is missing or not a trajectory.

    Examples:
        >>> import surfsup as sf
        >>> scene = sf.Scene(fluid=[sf.Block((-0.1, -0.1, 0.5), (0.1, 0.1, 0.7))], frames=20)
        >>> sf.Simulation(scene).record("water.h5")
        >>> sf.show("water.h5")
        Player of ... kB
    """
    with tempfile.TemporaryDirectory() as folder:
        page = write_trajectory_page(Path(trajectory), Path(folder) / "page.html", lambda done, total: None)
        return Player(page.read_text(encoding="utf-8"), height)
