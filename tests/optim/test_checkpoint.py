import pytest
import torch

from surfsup.errors import InputError
from surfsup.optim import checkpoint as module
from surfsup.optim.checkpoint import Checkpoint, CheckpointFiles


def checkpoint(step: int) -> Checkpoint:
    return Checkpoint({"a": torch.full((3,), float(step))}, {"step": step}, "{}")


@pytest.fixture
def files(tmp_path) -> CheckpointFiles:
    return CheckpointFiles(tmp_path)


def test_the_last_two_are_kept(files):
    assert not files.exist()
    for step in (1, 2, 3):
        files.save(checkpoint(step))
    assert files.load().counters == {"step": 3}
    assert torch.equal(files.load().tensors["a"], torch.full((3,), 3.0))
    assert module.read(files.before).counters == {"step": 2}
    assert sorted(path.name for path in files.last.parent.iterdir()) == [files.before.name, files.last.name]


@pytest.mark.parametrize("share", [0, 0.01, 0.5, 0.99])
def test_one_that_is_cut_off_is_named_and_the_one_before_it_taken(files, share):
    files.save(checkpoint(1))
    files.save(checkpoint(2))
    files.last.write_bytes(files.last.read_bytes()[: int(share * files.last.stat().st_size)])
    with pytest.warns(UserWarning, match=r"checkpoint\.safetensors: is cut off .*going on .*, at step 1") as told:
        assert files.load().counters == {"step": 1}
    assert all("\n" not in str(one.message) for one in told)
    files.save(checkpoint(3))
    assert (files.load().counters, module.read(files.before).counters) == ({"step": 3}, {"step": 1})


def test_a_kill_between_writing_and_naming_leaves_the_one_before(files):
    files.save(checkpoint(1))
    files.save(checkpoint(2))
    files.last.unlink()
    with pytest.warns(UserWarning, match="at step 1"):
        assert files.load().counters == {"step": 1}


@pytest.mark.parametrize("share", [0, 0.5, 0.99])
def test_with_none_before_it_is_refused_in_one_line(files, share):
    files.save(checkpoint(1))
    files.last.write_bytes(files.last.read_bytes()[: int(share * files.last.stat().st_size)])
    with pytest.raises(InputError, match="is cut off or no checkpoint") as error:
        files.load()
    assert "\n" not in str(error.value)


def test_none_at_all_is_refused(files):
    with pytest.raises(InputError, match="there is no checkpoint to resume"):
        files.load()


def test_a_full_disk_leaves_the_checkpoints_that_were_there(files, monkeypatch):
    def full(*arguments, **options):
        raise OSError(28, "No space left on device")

    files.save(checkpoint(1))
    before = files.last.read_bytes()
    monkeypatch.setattr(module, "save_file", full)
    with pytest.raises(InputError, match="cannot be written"):
        files.save(checkpoint(2))
    assert files.last.read_bytes() == before
