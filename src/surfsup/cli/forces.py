"""`surfsup forces`: the forces of the fluid on the solids of a trajectory."""

from __future__ import annotations

from typing import Annotated

import typer

from surfsup.cli.view import TrajectoryFile


def forces(
    trajectory: TrajectoryFile,
    solid: Annotated[
        list[str] | None, typer.Option(help="Name of a solid, or container; give it again for more. All by default.")
    ] = None,
) -> None:
    """Write the forces on solids as a table and a plot.

    forces.csv and forces.png are written next to the trajectory. Its scene must have the key 'forces: all', or a list
    of solids there.

    Example: surfsup forces out/boat
    """
    from surfsup.io.force_table import recorded_solids, write_force_table
    from surfsup.io.trajectory import Trajectory
    from surfsup.viewing.force_plot import plot_forces

    with Trajectory(trajectory) as opened:
        names = recorded_solids(opened, trajectory, solid or ())
        table, plot = trajectory.with_name("forces.csv"), trajectory.with_name("forces.png")
        write_force_table(opened, names, table)
        plot_forces(opened, names, plot)
    typer.echo(f"written to {table} and {plot}")
