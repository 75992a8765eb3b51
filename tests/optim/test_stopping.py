import os
import signal

import pytest

from surfsup.errors import InputError
from surfsup.optim import stopping
from surfsup.optim.stopping import Stop, parse_duration


def test_a_time_limit_stops():
    assert not Stop()()
    assert not Stop(1000)()
    assert Stop(0)()


def test_the_time_limit_counts_from_the_first_call(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(stopping.time, "monotonic", lambda: now[0])
    stop = Stop(10)
    now[0] = 1000.0
    assert not stop()
    now[0] = 1009.9
    assert not stop()
    now[0] = 1010.0
    assert stop()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_and_a_second_one_interrupts(number):
    before = signal.getsignal(number)
    with Stop() as stop:
        assert not stop()
        os.kill(os.getpid(), number)
        assert stop()
        assert stop.signaled
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert signal.getsignal(number) is before


@pytest.mark.parametrize(("text", "seconds"), [("90s", 90), ("30m", 1800), ("1.5h", 5400), (" 2m", 120)])
def test_durations_have_a_unit(text, seconds):
    assert parse_duration(text) == seconds


@pytest.mark.parametrize("text", ["", "5", "m", "-3m", "0s", "infs", "nanm", "3 days"])
def test_other_texts_are_not_durations(text):
    with pytest.raises(InputError, match="is not a length of time"):
        parse_duration(text)
