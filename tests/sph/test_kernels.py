import numpy as np
import pytest
import torch

from surfsup.sph.kernels import KERNEL_PEAK, KERNEL_SUPPORT, cubic_spline, cubic_spline_gradient


def test_the_kernel_integrates_to_one():
    q = np.linspace(0, 1, 2001)
    shells = 4 * np.pi * (q * KERNEL_SUPPORT) ** 2
    integral = np.trapezoid(shells * KERNEL_PEAK * cubic_spline(q), q * KERNEL_SUPPORT)
    assert integral == pytest.approx(1, abs=1e-6)


def test_the_support_is_two_particle_spacings():
    assert abs(KERNEL_SUPPORT - 0.06) < 1e-12


def test_the_kernel_falls_from_one_at_the_center_to_zero_at_the_support():
    np.testing.assert_allclose(cubic_spline(np.array([0.0, 0.5, 1.0, 1.5, np.inf])), [1, 0.25, 0, 0, 0], atol=1e-15)
    np.testing.assert_allclose(cubic_spline_gradient(np.array([0.0, 0.5, 1.0, 1.5])), [0, -1.5, 0, 0], atol=1e-15)


def test_the_kernel_is_the_piecewise_cubic_of_the_literature():
    q = np.linspace(0, 1, 101)
    expected = np.where(q <= 0.5, 6 * (q**3 - q**2) + 1, 2 * (1 - q) ** 3)
    np.testing.assert_allclose(cubic_spline(q), expected, atol=1e-14)


def test_the_gradient_is_that_of_finite_differences():
    q, step = np.linspace(0.01, 1.2, 120), 1e-6
    differences = (cubic_spline(q + step) - cubic_spline(q - step)) / (2 * step)
    np.testing.assert_allclose(cubic_spline_gradient(q), differences, atol=1e-5)


def test_tensors_give_the_values_of_arrays_and_have_gradients():
    q = torch.linspace(0, 1.2, 61, dtype=torch.float64, requires_grad=True)
    values = cubic_spline(q)
    np.testing.assert_allclose(values.detach(), cubic_spline(q.detach().numpy()), atol=1e-15)
    (slope,) = torch.autograd.grad(values.sum(), q)
    torch.testing.assert_close(slope, cubic_spline_gradient(q.detach()))


def test_nan_stays_nan():
    assert np.isnan(cubic_spline(np.array([np.nan]))).all()
    assert cubic_spline(torch.tensor([torch.nan])).isnan().all()
