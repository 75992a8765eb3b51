"""`surfsup live`: water in real time in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from surfsup.cli.scene_options import SceneOptions


def live(
    scene_options: SceneOptions,
    host: Annotated[str, typer.Option(help="Address to listen on; 0.0.0.0 for the whole network.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port to listen on.")] = 8080,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder of the recordings.")] = Path("out/live"),
) -> None:
    """Watch water in real time and change it, in a browser.

    Example: surfsup live examples/knot.obj
    """
    scene_options.check()
    from surfsup.live.serve import LiveServer, require_port, require_viser

    require_viser()
    require_port(host, port)
    scene = scene_options.read()
    with scene_options.named():
        server = LiveServer(scene, out, host, port)
    typer.echo(f"open http://{host}:{port} in a browser; Ctrl-C ends it")
    try:
        server.run()
    except KeyboardInterrupt:
        typer.echo("ended")
    finally:
        server.close()
