import os
import signal

import pytest

from surfsup.optim.stopping import Stop


def test_time_that_is_up_stops():
    assert not Stop()()
    assert not Stop(1000)()
    assert Stop(0)()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_and_a_second_one_ends_at_once(number):
    before = signal.getsignal(number)
    with Stop() as stop:
        assert not stop()
        os.kill(os.getpid(), number)
        assert stop()
        assert stop.signaled
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), number)
    assert signal.getsignal(number) is before
