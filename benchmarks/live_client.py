"""What the live page's server gives to a client that receives every picture and draws none.

    python benchmarks/live_client.py [--particles 3000] [--seconds 15] [--surface]

Without a GPU a browser draws on the processor, and measures itself. This client speaks viser's own protocol in a
process of its own, unpacks every message, and counts the pictures in them: particles with their colors, or a surface.
The remainder is the server: simulated seconds and pictures a second, and its processor time. Other work on the
machine slows both down; the processor time of a picture and of a step, which it changes little, says what an idle
core would reach.

Needs the extra `live`. The results are written to `benchmarks/results/live_client_*.json`.
"""

from __future__ import annotations

import argparse
import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import msgspec
import torch
import viser
import zstandard
from viser._messages import ViewerCameraMessage
from websockets.sync.client import connect

from live import PICTURES, Timed, scene
from record import write_result
from surfsup.live.drawn_water import PARTICLES, SURFACE
from surfsup.live.serve import LiveServer

CAMERA = ViewerCameraMessage((1, 0, 0, 0), (3, 3, 2), 0.8, 0.01, 100.0, 800, 1000, (0, 0, 0), (0, 0, 1))
WARM_UP = 2.0  # seconds


def receive(port: int, seconds: float) -> dict[str, float]:
    """Receive for some seconds: pictures and megabytes a second."""
    address, protocol = f"ws://127.0.0.1:{port}", f"viser-v{viser.__version__}"
    pictures, received, start = 0, 0, time.monotonic()
    with connect(address, subprotocols=[protocol], max_size=None) as server:  # type: ignore[list-item]
        server.send(msgspec.msgpack.encode(CAMERA.as_serializable_dict()))
        while (now := time.monotonic()) < start + WARM_UP + seconds:
            message = server.recv(timeout=30)
            if now >= start + WARM_UP:
                pictures += pictures_of(message)
                received += len(message)
    return {"pictures": pictures / seconds, "megabytes": received / seconds / 1e6}


def pictures_of(message: bytes | str) -> int:
    """How often a message has the water anew."""
    assert isinstance(message, bytes)
    length = int.from_bytes(message[8:16], "little")
    content = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(message[16 : 16 + length]))
    return sum(is_water(each) for each in content["messages"])


def is_water(message: dict[str, Any]) -> bool:
    """Whether one message has the particles, or the surface of the water."""
    if str(message.get("name", "")).strip("/") == PARTICLES:
        return "points" in message.get("updates", {})
    return str(message.get("name", "")).strip("/").startswith(SURFACE) and "props" in message


def main() -> None:
    """Measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--particles", type=int, default=3000)
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--surface", action="store_true", help="the surface of the water instead of particles")
    parser.add_argument("--child", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        print(json.dumps(receive(arguments.child, arguments.seconds)))
        return
    torch.set_num_threads(1)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    ended, style = threading.Event(), SURFACE if arguments.surface else PARTICLES
    with tempfile.TemporaryDirectory() as folder:
        server = LiveServer(scene(arguments.particles), Path(folder), port=port)
        server._page._style.value = style
        world = server._world
        step, show = Timed(world.step), Timed(server._page.show)
        world.step, server._page.show = step, show  # type: ignore[method-assign]
        loop = threading.Thread(target=server.run, args=(ended.is_set,))
        loop.start()
        try:
            command = [sys.executable, __file__, "--child", str(port), "--seconds", str(arguments.seconds)]
            with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
                while not server._server.get_clients():
                    time.sleep(0.02)
                time.sleep(WARM_UP)
                start, processor, simulated = time.monotonic(), time.process_time(), world.simulation.time
                steps, shows, spent = step.calls, show.calls, step.seconds + show.seconds
                time.sleep(arguments.seconds)
                elapsed, used = time.monotonic() - start, time.process_time() - processor
                of_real_time = (world.simulation.time - simulated) / elapsed
                made, done = show.calls - shows, step.calls - steps
                send = 1000 * (used - (step.seconds + show.seconds - spent)) / max(1, made)
                received = json.loads(child.communicate()[0])
        finally:
            ended.set()
            loop.join()
            server.close()
    cores = (step.milliseconds() / world.frame_time + PICTURES * (show.milliseconds() + send)) / 1000
    values = {
        "particles": len(world.frame.positions),
        "of_real_time": round(of_real_time, 3),
        "steps_per_second": round(done / elapsed, 1),
        "pictures_made_per_second": round(made / elapsed, 1),
        "pictures_received_per_second": round(received["pictures"], 1),
        "megabytes_received_per_second": round(received["megabytes"], 2),
        "cores_used": round(used / elapsed, 2),
        "processor_ms_per_step": round(step.milliseconds(), 2),
        "processor_ms_per_picture": round(show.milliseconds(), 2),
        "processor_ms_to_send_a_picture": round(send, 2),
        "cores_for_real_time": round(cores, 2),
        "seconds": round(elapsed, 1),
        "load_average": round(os.getloadavg()[0], 1),
    }
    print(values)
    write_result(
        f"live_client_{style}",
        f"Pictures a second that a client receives of the live page, {style}, {values['particles']:,} particles",
        values["pictures_received_per_second"],
        "1/s",
        None,
        None,
        f"python benchmarks/live_client.py{' --surface' if arguments.surface else ''}",
        values,
        1,
    )


if __name__ == "__main__":
    main()
