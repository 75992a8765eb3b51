import socket

import pytest

from surfsup.errors import InputError
from surfsup.live import serve


def test_a_port_in_use_is_one_line():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(InputError, match=f"port {port} of 127.0.0.1 cannot be opened .*--port"):
            serve.require_port("127.0.0.1", port)
    serve.require_port("127.0.0.1", port)


def test_a_host_that_is_not_this_machine_is_one_line():
    with pytest.raises(InputError, match=r"port 8080 of 203\.0\.113\.1 cannot be opened"):
        serve.require_port("203.0.113.1", 8080)


def test_without_the_extra_the_command_is_named(monkeypatch):
    monkeypatch.setattr(serve, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'surfsup\[live\]'"):
        serve.require_viser()
