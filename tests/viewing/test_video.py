import av
import numpy as np
import pytest

from surfsup.viewing.video import choose_frames, write_video


def images(count):
    return (np.full((48, 65, 3), 20 * i, np.uint8) for i in range(count))


def test_a_video_is_read_back_as_written(tmp_path):
    calls = []
    write_video(tmp_path / "new" / "v.mp4", images(10), 25, lambda done, total: calls.append((done, total)), total=10)
    with av.open(str(tmp_path / "new" / "v.mp4")) as video:
        stream = video.streams.video[0]
        assert stream.codec_context.name == "h264" and stream.codec_context.pix_fmt == "yuv420p"
        assert stream.average_rate == 25
        frames = [frame.to_ndarray(format="rgb24") for frame in video.decode(stream)]
    assert len(frames) == 10 and frames[0].shape == (48, 64, 3), "an odd side loses its last pixel"
    assert abs(float(frames[5].mean()) - 100) < 6
    assert calls == [(i, 10) for i in range(1, 11)]
    data = (tmp_path / "new" / "v.mp4").read_bytes()
    assert data.index(b"moov") < data.index(b"mdat"), "the index comes first"


def test_a_failure_keeps_the_old_file_and_leaves_no_other(tmp_path):
    (tmp_path / "v.mp4").write_bytes(b"old")

    def failing_images():
        yield from images(2)
        raise RuntimeError("no more")

    with pytest.raises(RuntimeError):
        write_video(tmp_path / "v.mp4", failing_images())
    assert [p.name for p in tmp_path.iterdir()] == ["v.mp4"] and (tmp_path / "v.mp4").read_bytes() == b"old"


def test_no_images_and_mixed_sizes_are_rejected(tmp_path):
    with pytest.raises(ValueError, match="at least one"):
        write_video(tmp_path / "v.mp4", [])
    with pytest.raises(ValueError, match="image 2 is 32x32"):
        write_video(tmp_path / "v.mp4", [np.zeros((16, 16, 3), np.uint8), np.zeros((32, 32, 3), np.uint8)])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("count", "stride"), [(801, 8), (1, 8), (4000, 34)])
def test_videos_are_in_real_time_unless_there_are_too_many_frames(count, stride):
    chosen = choose_frames(count)
    assert chosen[0] == 0 and len(chosen) <= 120 and (np.diff(chosen) == stride).all()
