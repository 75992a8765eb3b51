import pytest
import torch

from surfsup.sph.warp_engine.solver import FACTORIES
from tests.warp_compilation import assert_compile


@pytest.mark.parametrize("architecture", [80, 90])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_all_kernels_compile_for_gpus(architecture, dtype, tmp_path):
    assert_compile(FACTORIES, architecture, dtype, tmp_path)
