import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.viewing.camera import ViewDirection
from surfsup.viewing.video_settings import VideoSettings


@pytest.mark.parametrize("fps", [24, 25, 30, 50, 60, 59.94])
def test_a_video_is_in_real_time_at_any_rate(fps):
    frames = VideoSettings(fps=fps).frames(801, 0.005)
    times = np.arange(len(frames)) / fps
    assert np.abs(frames * 0.005 - times).max() <= 0.0025 + 1e-9, "each picture is that of the nearest frame"
    assert 4 - 1 / fps - 1e-9 <= times[-1] <= 4


def test_by_default_long_trajectories_are_played_faster_and_every_picks_frames():
    assert len(VideoSettings().frames(4000, 0.005)) <= 120
    assert len(VideoSettings(fps=25).frames(4000, 0.005)) == 500
    np.testing.assert_array_equal(VideoSettings(every=3, fps=60).frames(10, 0.005), [0, 3, 6, 9])


def test_a_turntable_goes_around_once():
    np.testing.assert_allclose(VideoSettings(turntable=True).angles(4), [0, 90, 180, 270])
    assert not VideoSettings().angles(4).any()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: VideoSettings(size=(10, 720)), "size: 10x720"),
        (lambda: VideoSettings(fps=0), "fps: 0 is not"),
        (lambda: VideoSettings(fps=float("nan")), "fps: nan is not"),
        (lambda: VideoSettings(every=0), "every: 0"),
        (lambda: VideoSettings(fps=60).frames(10, 1 / 24), "24 frames per second, fewer than 60; --every 1 shows"),
        (lambda: ViewDirection(1000, 10), "azimuth of 1000"),
        (lambda: ViewDirection(0, -10), "elevation of -10"),
        (lambda: ViewDirection(0, 10, 0), "zoom of 0"),
    ],
)
def test_values_out_of_range_are_named(make, message):
    with pytest.raises(InputError, match=message):
        make()
