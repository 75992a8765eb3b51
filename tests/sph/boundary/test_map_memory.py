"""A map that would not fit into the memory is refused before its memory is taken, and the remedy fits."""

import re

import numpy as np
import pytest

from surfsup.errors import InputError
from surfsup.sph.boundary.volume_map import BYTES_PER_CELL, require_memory


def test_a_map_too_large_is_refused_with_a_factor_that_fits(monkeypatch):
    monkeypatch.setattr("surfsup.sph.boundary.volume_map.available_memory", lambda: 10**9)
    padding = np.array([2, 2, 2])
    require_memory(np.array([80, 80, 80]), padding)
    flat = np.array([80_000, 80_000, 10])
    with pytest.raises(InputError, match="too little memory") as error:
        require_memory(flat, padding)
    factor = float(re.search(r"particle_radius (\S+) times", str(error.value))[1])
    assert 0.5e9 < BYTES_PER_CELL * np.prod(np.ceil(flat / factor) + 4) < 1e9
