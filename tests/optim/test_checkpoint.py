import pytest
import torch
from safetensors.torch import load_file, save_file

from surfsup.errors import InputError
from surfsup.optim import checkpoint as module
from surfsup.optim.checkpoint import Checkpoint, CheckpointFiles, load_optimizer_state, optimizer_state


def checkpoint(step: int) -> Checkpoint:
    return Checkpoint({"a": torch.full((3,), float(step))}, {"step": step}, "{}")


@pytest.fixture
def files(tmp_path) -> CheckpointFiles:
    return CheckpointFiles(tmp_path)


def test_the_last_two_checkpoints_are_kept(files):
    assert not files.exist()
    for step in (1, 2, 3):
        files.save(checkpoint(step))
    assert files.load().counters == {"step": 3}
    assert torch.equal(files.load().tensors["a"], torch.full((3,), 3.0))
    assert module.read(files.previous).counters == {"step": 2}
    assert sorted(path.name for path in files.last.parent.iterdir()) == [files.previous.name, files.last.name]


@pytest.mark.parametrize("share", [0, 0.01, 0.5, 0.99])
def test_a_truncated_checkpoint_is_named_and_the_previous_one_is_loaded(files, share):
    files.save(checkpoint(1))
    files.save(checkpoint(2))
    files.last.write_bytes(files.last.read_bytes()[: int(share * files.last.stat().st_size)])
    with pytest.warns(
        UserWarning, match=r"checkpoint\.safetensors: is cut off .*resuming from .*, at step 1"
    ) as caught:
        assert files.load().counters == {"step": 1}
    assert all("\n" not in str(one.message) for one in caught)
    files.save(checkpoint(3))
    assert (files.load().counters, module.read(files.previous).counters) == ({"step": 3}, {"step": 1})


def test_a_kill_between_writing_and_renaming_leaves_the_previous_checkpoint(files):
    files.save(checkpoint(1))
    files.save(checkpoint(2))
    files.last.unlink()
    with pytest.warns(UserWarning, match="at step 1"):
        assert files.load().counters == {"step": 1}


@pytest.mark.parametrize("share", [0, 0.5, 0.99])
def test_a_truncated_checkpoint_without_a_previous_one_is_refused_in_one_line(files, share):
    files.save(checkpoint(1))
    files.last.write_bytes(files.last.read_bytes()[: int(share * files.last.stat().st_size)])
    with pytest.raises(InputError, match="is cut off or no checkpoint") as error:
        files.load()
    assert "\n" not in str(error.value)


def test_a_missing_checkpoint_is_refused(files):
    with pytest.raises(InputError, match="there is no checkpoint to resume"):
        files.load()


def test_checkpoints_of_version_0_1_are_refused_in_one_line(files):
    """They have the same header without a format."""
    for step in (1, 2):
        files.save(checkpoint(step))
    for path in (files.previous, files.last):
        save_file(load_file(path), path, {"run": '{"step": 1}', "config": "{}"})
    with pytest.raises(InputError, match=r"of another version of surfsup, .*; start a new run") as error:
        files.load()
    assert "\n" not in str(error.value)


def test_a_full_disk_leaves_the_existing_checkpoints(files, monkeypatch):
    def full(*arguments, **options):
        raise OSError(28, "No space left on device")

    files.save(checkpoint(1))
    before = files.last.read_bytes()
    monkeypatch.setattr(module, "save_file", full)
    with pytest.raises(InputError, match="cannot be written"):
        files.save(checkpoint(2))
    assert files.last.read_bytes() == before


def test_an_optimizer_state_that_single_precision_cannot_hold_is_refused():
    parameter = torch.nn.Parameter(torch.ones(2))
    optimizer = torch.optim.Adam([parameter])
    parameter.sum().backward()
    optimizer.step()
    state = optimizer_state(optimizer)
    load_optimizer_state(optimizer, state)
    with pytest.raises(
        ValueError, match=r"'optimizer\.0\.exp_avg' has numbers that are not finite in single precision"
    ):
        load_optimizer_state(optimizer, {**state, "0.exp_avg": torch.full((2,), 1e300, dtype=torch.float64)})
