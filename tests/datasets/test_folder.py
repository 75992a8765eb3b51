import pytest

from surfsup.datasets.folder import atomic_write, lock_folder, lock_token
from surfsup.errors import InputError


def test_a_file_appears_only_when_it_is_complete(tmp_path):
    with atomic_write(tmp_path / "a.h5") as path:
        path.write_text("half")
        assert not (tmp_path / "a.h5").exists()
        assert path.parent == tmp_path
        path.write_text("whole")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.h5", "whole")]


def test_an_error_leaves_no_partial_file_and_keeps_the_old_one(tmp_path):
    (tmp_path / "a.h5").write_text("old")
    with pytest.raises(ZeroDivisionError), atomic_write(tmp_path / "a.h5") as path:
        path.write_text("half")
        raise ZeroDivisionError
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.h5", "old")]


def test_two_writers_of_one_file_do_not_conflict(tmp_path):
    with atomic_write(tmp_path / "a.h5") as one, atomic_write(tmp_path / "a.h5") as other:
        one.write_text("same")
        other.write_text("same")
        assert one != other
    assert (tmp_path / "a.h5").read_text() == "same"


def test_partial_files_of_a_killed_run_are_removed_and_other_files_stay(tmp_path):
    (tmp_path / "surfaces").mkdir()
    for name in (".00001.h5.0123.partial", "00000.h5", "notes.partial", "surfaces/.a.ply.4.partial", "surfaces/b.ply"):
        (tmp_path / name).write_text("x")
    with lock_folder(tmp_path):
        assert {path.name for path in tmp_path.iterdir()} == {".lock", "00000.h5", "notes.partial", "surfaces"}
        assert [path.name for path in (tmp_path / "surfaces").iterdir()] == ["b.ply"]


def test_one_run_holds_the_lock_and_its_token_identifies_it(tmp_path):
    with lock_folder(tmp_path) as first:
        assert lock_token(tmp_path) == first
        with pytest.raises(InputError, match="another run is writing into it"), lock_folder(tmp_path):
            pass
    with lock_folder(tmp_path) as second:
        assert lock_token(tmp_path) == second != first
    assert lock_token(tmp_path / "elsewhere") == ""


def test_a_new_folder_that_stays_empty_is_removed(tmp_path):
    with lock_folder(tmp_path / "a"):
        pass
    with lock_folder(tmp_path / "b"):
        (tmp_path / "b" / "00000.h5").touch()
    assert [path.name for path in tmp_path.iterdir()] == ["b"]


def test_a_file_at_the_folders_path_is_an_error(tmp_path):
    (tmp_path / "a").touch()
    with pytest.raises(InputError, match="cannot be used as the folder of a data set"), lock_folder(tmp_path / "a"):
        pass
