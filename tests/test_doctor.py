from surfsup import doctor, native
from surfsup.splishsplash import solver
from surfsup.viewing import graphics


def test_everything_is_looked_at_and_what_is_fine_needs_no_remedy():
    findings = doctor.examine()
    assert [finding.what for finding in findings] == [
        "Python", "torch", "native step", "processor", "models", "neural surfaces", "pictures",
        "reference solver", "disk",
    ]  # fmt: skip
    assert all(not finding.remedy for finding in findings if finding.fine)


def test_missing_graphics_are_mended_by_their_packages(monkeypatch):
    monkeypatch.setattr(graphics, "missing_packages", lambda: ["libegl1"])
    finding = doctor.pictures()
    assert not finding.fine
    assert finding.remedy == "apt-get install libegl1"


def test_a_missing_solver_is_mended_by_its_command(monkeypatch):
    def refuse():
        raise solver.InputError(
            "the reference solver needs libGL.so.1, which this system lacks: apt-get install libgl1"
        )

    monkeypatch.setattr(solver, "require", refuse)
    finding = doctor.reference_solver()
    assert not finding.fine
    assert finding.remedy == "apt-get install libgl1"


def test_a_package_built_without_a_compiler_says_what_it_costs_and_how_to_mend_it(monkeypatch):
    monkeypatch.setattr(native, "instruction_sets", list)
    finding = doctor.native_step()
    assert not finding.fine
    assert "several times as long" in finding.found
    assert "apt-get install g++ python3-dev" in finding.remedy


def test_a_native_step_is_named_by_its_instruction_set(monkeypatch):
    monkeypatch.setattr(native, "instruction_sets", lambda: ["avx2", "plain"])
    assert doctor.native_step().found == "built, uses avx2"
