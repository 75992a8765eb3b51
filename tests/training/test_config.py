import pytest

from surfsup.errors import InputError
from surfsup.learned.message_passing.architecture import MessagePassingArchitecture
from surfsup.training.config import Phase, TrainingConfig, load_config


def error_of(name: str, *overrides: str) -> str:
    with pytest.raises(InputError) as error:
        load_config(name, overrides)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize("name", ["corrected", "surfsup", "value-only", "no-sdf", "gns", "decay", "paper-recipe"])
def test_every_preset_is_valid_and_covers_all_steps(name):
    config = load_config(name)
    assert config.phases[-1].until == 1
    assert [phase.until for phase in config.phases] == sorted(phase.until for phase in config.phases)


def test_the_paper_recipe_is_that_of_the_supplement():
    config = load_config("paper-recipe")
    assert config.architecture == MessagePassingArchitecture(width=128, layers=10)
    assert (config.optimizer, config.schedule, config.steps, config.warm_up) == ("adam", "exponential", 2_000_000, 0)
    assert (config.learning_rate, config.final_learning_rate) == (1e-4, 1e-6)
    assert config.phases == [Phase(until=1, noise=3e-4, noise_decades=0)]


def test_the_recipe_of_the_paper_s_networks_has_no_collision_handling_and_can_be_continued():
    config = load_config("surfsup")
    assert (config.steps, config.schedule) == (100_000, "inverse-sqrt")
    assert not config.validation_collisions
    assert not any(phase.handle_collisions for phase in config.phases if phase.pushforward)


def test_the_preset_decay_ends_a_run_of_the_preset_surfsup():
    long, end = load_config("surfsup"), load_config("decay", ["kind=gns"])
    assert (end.schedule, end.final_learning_rate, end.kind) == ("cosine", 0, "gns")
    assert end.phases == long.phases[-1:]
    assert end.architecture.width == long.architecture.width


def test_overrides_replace_values_of_the_preset():
    config = load_config("corrected", ["steps=10", "learning_rate=1e-3", "seed=7", "phases=[{until: 1, noise: 0}]"])
    assert (config.steps, config.learning_rate, config.seed) == (10, 1e-3, 7)
    assert config.phases == [Phase(until=1, noise=0)]
    assert config.width == load_config("corrected").width


def test_a_file_can_replace_a_preset(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("kind: surfsup\nsteps: 12\nphases: [{until: 1.0}]")
    assert load_config(str(path)) == TrainingConfig(kind="surfsup", steps=12, phases=[Phase(until=1.0)])


def test_a_configuration_is_unchanged_by_json():
    config = load_config("corrected")
    assert TrainingConfig.model_validate_json(config.model_dump_json()) == config


@pytest.mark.parametrize("name", ["surfsup", "value-only", "no-sdf", "gns"])
def test_the_presets_of_the_paper_s_networks_differ_only_in_their_kind(name):
    config = load_config(name)
    assert config == load_config("surfsup").model_copy(update={"kind": name})
    assert (config.architecture.width, config.architecture.layers) == (64, 5)
    paper = load_config(name, ["size=paper", "layers=3"])
    assert (paper.architecture.width, paper.architecture.layers) == (128, 3)


def test_a_file_can_extend_a_preset(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("like: gns\nsurface_particles: 5000")
    assert load_config(str(path)) == load_config("gns", ["surface_particles=5000"])
    path.write_text("like: gsn")
    assert "like: there is no preset 'gsn'" in error_of(str(path))


@pytest.mark.parametrize(
    ("preset", "override", "message"),
    [
        ("surfsup", "surface_particles=5", "'surface_particles' is not a size of kind 'surfsup'"),
        ("corrected", "surface_particles=4", "'surface_particles' is not a size of kind 'corrected'"),
        ("corrected", "size=paper", "kind 'corrected' has no named sizes"),
        ("corrected", "precision=bf16", "kind 'corrected' computes in precision 32 only"),
        ("corrected", "phases=[{until: 1, density: 1}]", "'density' is not for kind 'corrected'"),
        ("corrected", "phases=[{until: 1, displaced: 0.1}]", "'displaced' is not for kind 'corrected'"),
        ("surfsup", "layers=1000", "layers is 1000"),
    ],
)
def test_options_that_a_kind_does_not_have_are_refused(preset, override, message):
    assert message in error_of(preset, override)


@pytest.mark.parametrize("precision", ["32", "bf16"])
def test_the_precision_may_be_a_yaml_number(precision):
    assert load_config("surfsup", [f"precision={precision}"]).precision == precision


@pytest.mark.parametrize(
    ("override", "message"),
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
        ("kind=corected", "there is no kind 'corected' (did you mean 'corrected'?)"),
        ("schedule=linear", "schedule: "),
        ("precision=16", "precision: "),
        ("phases=[{until: 1, pushforward: -1}]", "phases.0.pushforward: "),
    ],
)
def test_a_wrong_override_is_named(override, message):
    assert message in error_of("corrected", override)


def test_an_unknown_preset_is_answered_with_the_known_ones():
    assert "no training preset or file 'corected' (did you mean 'corrected'?); presets are corr" in error_of("corected")
    assert "file 'xyzzy'; presets are" in error_of("xyzzy")


@pytest.mark.parametrize("content", [b"steps: [", b"- 1", b"words", bytes(range(256)), b"", b"a: &b 1\nc: *b"])
def test_a_file_that_is_not_a_configuration_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "wrong.yaml"
    path.write_bytes(content)
    assert str(path) in error_of(str(path))


def test_a_step_belongs_to_the_first_phase_that_has_not_ended():
    phases = [Phase(until=0.5), Phase(until=0.8), Phase(until=1.0)]
    config = TrainingConfig(kind="corrected", steps=10, phases=phases)
    assert [config.phases.index(config.phase(step)) for step in range(10)] == [0] * 5 + [1] * 3 + [2] * 2
    assert [config.first_step_of_phase(step) for step in (0, 4, 5, 9)] == [0, 0, 5, 8]


def test_the_last_phase_goes_on_to_the_last_step():
    config = TrainingConfig(kind="corrected", steps=10, phases=[Phase(until=0.5)])
    assert config.phase(9) is config.phases[0]
