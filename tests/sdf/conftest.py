import os

import pytest
from hypothesis import settings

from tests.sdf.solids import SHAPES

settings.register_profile("surfaces", max_examples=30, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "surfaces"))


@pytest.fixture(params=list(SHAPES))
def shape(request):
    """The class of a primitive and its parameters."""
    return SHAPES[request.param]
