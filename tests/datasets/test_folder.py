import pytest

from surfsup.datasets.folder import locked, token_of, whole_file
from surfsup.errors import InputError


def test_a_file_appears_only_when_it_is_whole(tmp_path):
    with whole_file(tmp_path / "a.h5") as path:
        path.write_text("half")
        assert not (tmp_path / "a.h5").exists()
        assert path.parent == tmp_path
        path.write_text("whole")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.h5", "whole")]


def test_what_fails_leaves_nothing_and_keeps_what_was_there(tmp_path):
    (tmp_path / "a.h5").write_text("old")
    with pytest.raises(ZeroDivisionError), whole_file(tmp_path / "a.h5") as path:
        path.write_text("half")
        raise ZeroDivisionError
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.h5", "old")]


def test_two_at_the_same_file_do_not_meet(tmp_path):
    with whole_file(tmp_path / "a.h5") as one, whole_file(tmp_path / "a.h5") as other:
        one.write_text("same")
        other.write_text("same")
        assert one != other
    assert (tmp_path / "a.h5").read_text() == "same"


def test_what_a_killed_run_left_is_cleared_and_all_else_stays(tmp_path):
    for name in (".00001.h5.0123.partial", "00000.h5", "notes.partial"):
        (tmp_path / name).write_text("x")
    with locked(tmp_path):
        assert {path.name for path in tmp_path.iterdir()} == {".lock", "00000.h5", "notes.partial"}


def test_only_one_works_in_a_folder_and_its_token_tells_it_from_others(tmp_path):
    with locked(tmp_path) as first:
        assert token_of(tmp_path) == first
        with pytest.raises(InputError, match="another run is writing into it"), locked(tmp_path):
            pass
    with locked(tmp_path) as second:
        assert token_of(tmp_path) == second != first
    assert token_of(tmp_path / "elsewhere") == ""


def test_a_new_folder_in_which_nothing_was_made_is_removed_again(tmp_path):
    with locked(tmp_path / "a"):
        pass
    with locked(tmp_path / "b"):
        (tmp_path / "b" / "00000.h5").touch()
    assert [path.name for path in tmp_path.iterdir()] == ["b"]


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "a").touch()
    with pytest.raises(InputError, match="cannot be used as the folder of a data set"), locked(tmp_path / "a"):
        pass
