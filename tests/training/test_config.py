import pytest

from surfsup.errors import InputError
from surfsup.training.config import Phase, TrainingConfig, load_config, seconds_of


def complaint(name: str, *overrides: str) -> str:
    with pytest.raises(InputError) as error:
        load_config(name, list(overrides))
    assert "\n" not in str(error.value)
    return str(error.value)


def test_the_shipped_preset_is_valid_and_covers_all_steps():
    config = load_config("fast")
    assert config.phases[-1].until == 1
    assert [phase.until for phase in config.phases] == sorted(phase.until for phase in config.phases)


def test_overrides_replace_values_of_the_preset():
    config = load_config("fast", ["steps=10", "learning_rate=1e-3", "seed=7", "phases=[{until: 1, noise: 0}]"])
    assert (config.steps, config.learning_rate, config.seed) == (10, 1e-3, 7)
    assert config.phases == [Phase(until=1, noise=0)]
    assert config.width == load_config("fast").width


def test_a_file_is_as_good_as_a_preset(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("steps: 12\nphases: [{until: 1.0}]")
    assert load_config(str(path)) == TrainingConfig(steps=12, phases=[Phase(until=1.0)])


def test_a_configuration_survives_the_way_through_json():
    config = load_config("fast")
    assert TrainingConfig.model_validate_json(config.model_dump_json()) == config


@pytest.mark.parametrize("name", ["surfsup", "value-only", "no-sdf", "gns"])
def test_the_papers_networks_differ_in_their_kind_alone(name):
    config = load_config(name)
    assert config == load_config("surfsup").model_copy(update={"kind": name})
    assert (config.architecture.width, config.architecture.layers) == (64, 5)
    paper = load_config(name, ["size=paper", "layers=3"])
    assert (paper.architecture.width, paper.architecture.layers, paper.architecture.history) == (128, 3, 4)


def test_a_file_can_be_like_a_preset(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("like: gns\nsurface_particles: 5000")
    assert load_config(str(path)) == load_config("gns", ["surface_particles=5000"])
    path.write_text("like: gsn")
    assert "like: there is no preset 'gsn'" in complaint(str(path))


@pytest.mark.parametrize(
    ("preset", "override", "said"),
    [
        ("surfsup", "surface_particles=5", "'surface_particles' is no size of kind 'surfsup'"),
        ("fast", "history=4", "'history' is no size of kind 'convolution'"),
        ("fast", "size=paper", "kind 'convolution' has no sizes by name"),
        ("fast", "precision=bf16", "kind 'convolution' computes in precision 32 only"),
        ("surfsup", "phases=[{until: 1, calm: 1}]", "kind 'surfsup' has no calm term"),
        ("fast", "phases=[{until: 1, density: 1}]", "kind 'convolution' has no density term"),
        ("fast", "messages=17", "messages is 17, but must be 1 to 16, the width"),
        ("surfsup", "history=1000", "history is 1000"),
    ],
)
def test_what_a_kind_does_not_have_is_refused(preset, override, said):
    assert said in complaint(preset, override)


@pytest.mark.parametrize("precision", ["32", "bf16"])
def test_precision_can_be_written_as_a_number(precision):
    assert load_config("surfsup", [f"precision={precision}"]).precision == precision


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("stepps=10", "unknown key 'stepps'; did you mean 'steps'?"),
        ("phases=[{until: 1, noize: 1}]", "unknown key 'phases.0.noize'; did you mean 'noise'?"),
        ("steps", "'steps' is not of the form key=value"),
        ("steps=0", "steps: "),
        ("steps=many", "steps: "),
        ("steps=", "steps: "),
        ("steps=[1", "is not YAML"),
        ("radius=.nan", "radius: "),
        ("radius=-1", "radius: "),
        ("averaging=1.1", "averaging: "),
        ("seed=-1", "seed: "),
        ("phases=[]", "phases: "),
        ("phases=[{until: 2}]", "phases.0.until: "),
        ("phases=[{until: 0.5}, {until: 0.4}, {until: 1}]", "phases: each 'until' must be above the one before"),
        ("phases=[{until: 0.5}, {until: 0.5}]", "phases: each 'until' must be above the one before"),
        ("kind=convolutoin", "there is no kind 'convolutoin' (did you mean 'convolution'?)"),
        ("schedule=linear", "schedule: "),
        ("precision=16", "precision: "),
        ("phases=[{until: 1, unroll: 0}]", "phases.0.unroll: "),
    ],
)
def test_a_wrong_override_is_named(override, said):
    assert said in complaint("fast", override)


def test_an_unknown_preset_is_answered_with_those_there_are():
    assert "no training preset or file 'fats' (did you mean 'fast'?); presets are fast" in complaint("fats")
    assert "file 'xyzzy'; presets are" in complaint("xyzzy")


@pytest.mark.parametrize("content", [b"steps: [", b"- 1", b"words", bytes(range(256)), b"", b"a: &b 1\nc: *b"])
def test_a_file_that_is_no_configuration_is_one_line(tmp_path, content):
    path = tmp_path / "wrong.yaml"
    path.write_bytes(content)
    assert str(path) in complaint(str(path))


def test_steps_belong_to_the_phase_that_has_not_ended():
    config = TrainingConfig(steps=10, phases=[Phase(until=0.5), Phase(until=0.8), Phase(until=1.0)])
    assert [config.phases.index(config.phase(step)) for step in range(10)] == [0] * 5 + [1] * 3 + [2] * 2


def test_after_the_last_phase_comes_none():
    config = TrainingConfig(steps=10, phases=[Phase(until=0.5)])
    assert config.phase(9) is config.phases[0]


@pytest.mark.parametrize(("text", "seconds"), [("90s", 90), ("30m", 1800), ("1.5h", 5400), (" 2m", 120)])
def test_lengths_of_time(text, seconds):
    assert seconds_of(text) == seconds


@pytest.mark.parametrize("text", ["", "5", "m", "-3m", "0s", "infs", "nanm", "3 days"])
def test_what_is_no_length_of_time_is_refused(text):
    with pytest.raises(InputError, match="is not a length of time"):
        seconds_of(text)
