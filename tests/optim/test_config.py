import pytest

from surfsup.errors import InputError
from surfsup.optim.config import parse_overrides


def test_overrides_are_keys_with_yaml_values():
    assert parse_overrides(["steps=10", "rate=1.0e-3", "name=a=b", "phases=[{until: 1}]", "none=null"]) == {
        "steps": 10, "rate": 1e-3, "name": "a=b", "phases": [{"until": 1}], "none": None,
    }  # fmt: skip


@pytest.mark.parametrize(("override", "message"), [("steps", "is not of the form key=value"), ("a=[1", "is not YAML")])
def test_other_overrides_are_refused(override, message):
    with pytest.raises(InputError, match=message):
        parse_overrides([override])
