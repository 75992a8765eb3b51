import h5py
import pytest

from surfsup.errors import InputError
from surfsup.io.new_hdf5_file import new_hdf5_file


def test_a_file_has_its_name_when_its_head_is_whole(tmp_path):
    path = tmp_path / "a.h5"

    def head(file):
        assert not path.exists()
        file["head"] = 7

    new_hdf5_file(path, path, 4096, head).close()
    with h5py.File(path) as file:
        assert file["head"][()] == 7
    assert [one.name for one in tmp_path.iterdir()] == ["a.h5"]


@pytest.mark.parametrize("kind", [KeyboardInterrupt, RuntimeError])
def test_an_interrupt_or_error_leaves_an_older_file_and_no_other(tmp_path, kind):
    path = tmp_path / "a.h5"
    path.write_bytes(b"older")

    def interrupted(_):
        raise kind

    with pytest.raises(kind):
        new_hdf5_file(path, path, 4096, interrupted)
    assert [one.read_bytes() for one in tmp_path.iterdir()] == [b"older"]


def test_a_place_that_cannot_be_written_is_one_line_with_the_name_that_the_user_gave(tmp_path):
    with pytest.raises(InputError, match=r"given\.h5: cannot be written") as error:
        new_hdf5_file(tmp_path / "none" / "a.h5", tmp_path / "given.h5", 4096, lambda file: None)
    assert "\n" not in str(error.value)


def test_what_is_in_its_place_while_it_is_made_is_removed_and_not_followed(tmp_path):
    precious = tmp_path / "precious.txt"
    precious.write_text("years of work")
    (tmp_path / ".a.h5.partial").symlink_to(precious)
    new_hdf5_file(tmp_path / "a.h5", tmp_path / "a.h5", 4096, lambda file: None).close()
    assert precious.read_text() == "years of work"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["a.h5", "precious.txt"]
