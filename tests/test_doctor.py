from surfsup import doctor, native
from surfsup.splishsplash import solver
from surfsup.viewing import graphics


def test_everything_is_checked_and_a_passed_check_has_no_remedy():
    checks = doctor.run_checks()
    assert [check.name for check in checks] == [
        "Python", "torch", "native code", "processor", "speed", "weights", "neural surfaces", "graphics",
        "reference solver", "cache", "disk",
    ]  # fmt: skip
    assert all(not check.remedy for check in checks if check.passed)


def test_the_remedy_for_missing_graphics_is_to_install_the_packages(monkeypatch):
    monkeypatch.setattr(graphics, "missing_packages", lambda: ["libegl1"])
    check = doctor.check_graphics()
    assert not check.passed
    assert check.remedy == "apt-get install libegl1"


def test_the_remedy_for_a_missing_solver_is_the_command_of_its_error(monkeypatch):
    def refuse():
        raise solver.InputError(
            "the reference solver needs libGL.so.1, which this system lacks: apt-get install libgl1"
        )

    monkeypatch.setattr(solver, "check_installed", refuse)
    check = doctor.check_reference_solver()
    assert not check.passed
    assert check.remedy == "apt-get install libgl1"


def test_a_package_built_without_a_compiler_is_reported_with_its_cost_and_remedy(monkeypatch):
    monkeypatch.setattr(native, "instruction_sets", list)
    check = doctor.check_native_code()
    assert not check.passed
    assert "several times as long" in check.found
    assert "apt-get install g++ python3-dev" in check.remedy


def test_native_code_is_reported_with_its_instruction_set(monkeypatch):
    monkeypatch.setattr(native, "instruction_sets", lambda: ["avx2", "plain"])
    assert doctor.check_native_code().found == "built, uses avx2"
