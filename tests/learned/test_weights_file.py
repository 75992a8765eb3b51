import json
import pickle
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file, save_file

from surfsup.errors import InputError
from surfsup.learned import weights_file
from surfsup.learned.message_passing.architecture import MessagePassingArchitecture
from surfsup.learned.message_passing.no_sdf import NoSdf
from surfsup.learned.simulator_names import shipped

ARCHITECTURE = MessagePassingArchitecture(width=8, layers=3, radius=0.05)


@pytest.fixture
def simulator() -> NoSdf:
    torch.manual_seed(3)
    return NoSdf(ARCHITECTURE)


@pytest.fixture
def path(tmp_path, simulator) -> Path:
    path = tmp_path / "model.safetensors"
    weights_file.save(path, simulator, weights_file.Card("a name", "about it"))
    return path


def header(**changes: str) -> dict[str, str]:
    card = json.dumps({"name": "a", "about": "b"})
    sizes = json.dumps({"width": 8, "layers": 3, "radius": 0.05})
    return {"format": weights_file.FORMAT, "kind": NoSdf.kind, "architecture": sizes, "card": card, **changes}


def error_of(path: Path) -> str:
    with pytest.raises(InputError) as error:
        weights_file.load(path)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(str(path))
    return str(error.value)


def test_weights_are_restored_bit_for_bit_with_architecture_and_card(path, simulator):
    loaded, card = weights_file.load(path)
    assert loaded.architecture == ARCHITECTURE
    assert card == weights_file.Card("a name", "about it")
    assert set(loaded.state_dict()) == set(simulator.state_dict())
    for name, value in simulator.state_dict().items():
        assert torch.equal(loaded.state_dict()[name], value)
    assert not loaded.training
    assert not any(parameter.requires_grad for parameter in loaded.parameters())


def test_saving_again_replaces_the_file_and_leaves_no_partial_one(path, simulator):
    weights_file.save(path, simulator, weights_file.Card("another", ""))
    assert weights_file.load(path)[1].name == "another"
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 0.99])
def test_a_truncated_file_is_refused_in_one_line(path, share):
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    assert "truncated" in error_of(path)


def test_a_missing_file_or_a_folder_is_refused_in_one_line(tmp_path):
    assert "no such weights file" in error_of(tmp_path / "absent.safetensors")
    assert "no such weights file" in error_of(tmp_path)


class Bomb:
    def __reduce__(self):
        return (Path.touch, (Path(self.mark),))


def test_nothing_is_unpickled(tmp_path):
    bomb = Bomb()
    bomb.mark = str(tmp_path / "exploded")
    for name, write in (("pickle", pickle.dump), ("torch", torch.save)):
        path = tmp_path / f"{name}.safetensors"
        with path.open("wb") as file:
            write({"weights": bomb}, file)
        assert "pickled weights are refused" in error_of(path)
    assert not (tmp_path / "exploded").exists()
    with (tmp_path / "pickle.safetensors").open("rb") as file:
        pickle.load(file)
    assert (tmp_path / "exploded").exists(), "the pickle is a working bomb"


@pytest.mark.parametrize("metadata", [None, {}, {"format": "another-program-7"}])
def test_a_file_of_another_program_is_refused(path, metadata):
    save_file(load_file(path), path, metadata=metadata)
    assert "not weights of a simulator" in error_of(path)


def test_weights_of_another_version_are_refused_with_a_remedy(path):
    save_file(load_file(path), path, metadata=header(format="surfsup-simulator-4"))
    message = error_of(path)
    assert "'surfsup-simulator-4' of another version" in message and "train the model again" in message


def test_weights_of_format_5_have_the_node_features_of_their_time(path):
    save_file(load_file(path), path, metadata=header(format="surfsup-simulator-5"))
    simulator, _ = weights_file.load(path)
    assert simulator.architecture == MessagePassingArchitecture(width=8, layers=3, radius=0.05, features=1)
    weights_file.save(path, simulator, weights_file.Card("a name", "about it"))
    assert weights_file.load(path)[0].architecture.features == 1


@pytest.mark.parametrize(
    "changes",
    [
        {"architecture": "{"},
        {"architecture": "[]"},
        {"architecture": '{"depth": 3}'},
        {"architecture": '{"width": 9, "layers": 3, "radius": 0.05}'},
        {"architecture": '{"width": 8, "layers": 4, "radius": 0.05}'},
        {"architecture": '{"width": 8, "layers": 2, "radius": 0.05}'},
        {"architecture": '{"width": 8, "layers": 1000000000000, "radius": 0.05}'},
        {"architecture": '{"width": 1000000000, "layers": 3, "radius": 0.05}'},
        {"architecture": '{"width": "8", "layers": 3, "radius": 0.05}'},
        {"architecture": '{"width": 8, "layers": 3, "radius": "wide"}'},
        {"architecture": '{"width": 8, "layers": 3, "radius": NaN}'},
        {"architecture": '{"width": 8, "layers": 3, "radius": -1.0}'},
        {"card": "{}"},
        {"card": "7"},
        {"card": '{"name": "a", "about": "b", "training_domain": 7}'},
        {"card": '{"name": "a", "about": "b", "training_domain": {"sides": [1, 2]}}'},
    ],
)
def test_a_header_that_does_not_fit_is_refused_in_one_line(path, changes):
    save_file(load_file(path), path, metadata=header(**changes))
    assert "do not fit" in error_of(path)


def test_the_header_of_these_tests_fits_without_changes(path):
    save_file(load_file(path), path, metadata=header())
    assert weights_file.load(path)[0].architecture == ARCHITECTURE


def test_a_header_without_its_entries_is_refused_in_one_line(path):
    save_file(load_file(path), path, metadata={"format": weights_file.FORMAT})
    assert "do not fit" in error_of(path)


def test_tensors_of_another_shape_or_number_are_refused_in_one_line(path):
    tensors = load_file(path)
    name = next(iter(tensors))
    for spoiled in (
        {**tensors, name: torch.zeros(3, 3)},
        {key: value for key, value in tensors.items() if key != name},
        {**tensors, "one.too.many": torch.zeros(2)},
        {},
    ):
        save_file(spoiled, path, metadata=header())
        assert "do not fit" in error_of(path)


def test_a_model_is_found_by_its_name_or_by_its_file(path, monkeypatch):
    monkeypatch.setattr(weights_file, "shipped", lambda: {"surfsup": Path("the/shipped/one")})
    assert weights_file.find("surfsup") == Path("the/shipped/one")
    assert weights_file.find(str(path)) == path
    with pytest.raises(InputError, match="no weights 'secnd'; shipped are surfsup"):
        weights_file.find("secnd")


def test_all_shipped_weights_load():
    for name, path in shipped().items():
        _, card = weights_file.load(path)
        assert card.about, name
