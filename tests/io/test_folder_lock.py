import os
import subprocess
import sys

import pytest

from surfsup.errors import InputError
from surfsup.io.folder_lock import LOCK, locked_folder, take_lock


def test_a_second_run_is_refused_until_the_first_has_ended(tmp_path):
    with locked_folder(tmp_path / "out"):
        (tmp_path / "out" / "water.h5").touch()
        with pytest.raises(InputError, match="another run is writing into it"), locked_folder(tmp_path / "out"):
            pass
        assert (tmp_path / "out" / LOCK).exists()
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["water.h5"]
    with locked_folder(tmp_path / "out"):
        pass


def test_folders_that_stay_empty_are_removed_and_others_are_not(tmp_path):
    with locked_folder(tmp_path / "a" / "b"):
        pass
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "a").mkdir()
    with locked_folder(tmp_path / "a"):
        pass
    assert (tmp_path / "a").exists()


def test_a_lock_that_a_stranger_made_a_link_or_a_pipe_is_refused_and_nothing_is_written_through_it(tmp_path):
    """A data set's run writes into its lock; that may not be a file of the user's."""
    precious = tmp_path / "precious.txt"
    precious.write_text("years of work")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / LOCK).symlink_to(precious)
    with pytest.raises(InputError, match=r"its file \.lock is a link"):
        take_lock(tmp_path / "a")
    assert precious.read_text() == "years of work"
    (tmp_path / "b").mkdir()
    os.mkfifo(tmp_path / "b" / LOCK)
    with pytest.raises(InputError, match=r"its file \.lock is no plain file"):
        take_lock(tmp_path / "b")


def test_a_killed_run_leaves_no_lock(tmp_path):
    program = (
        "import sys, time; from pathlib import Path; from surfsup.io.folder_lock import take_lock\n"
        "lock = take_lock(Path(sys.argv[1])); print('locked', flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", program, tmp_path], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "locked\n"
        with pytest.raises(InputError, match="another run"):
            take_lock(tmp_path)
        child.kill()
        child.wait()
        with locked_folder(tmp_path):
            pass


def test_a_lock_file_that_is_removed_meanwhile_is_made_again(tmp_path):
    first = take_lock(tmp_path)
    (tmp_path / LOCK).unlink()
    with take_lock(tmp_path) as second, first:
        assert (tmp_path / LOCK).exists()
        assert second.fileno() != first.fileno()


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be used as the output folder"), locked_folder(tmp_path / "file" / "a"):
        pass
