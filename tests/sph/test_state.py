import torch

from surfsup.scene import FRAME_TIME
from surfsup.sph.state import SUBSTEP_TIME, SUBSTEPS, ParticleState, free_fall, free_fall_lag

GRAVITY = torch.tensor([0.3, 0.0, -9.81], dtype=torch.float64)


def test_ballistic_motion_equals_semi_implicit_euler_steps():
    random = torch.Generator().manual_seed(0)
    state = ParticleState(*(torch.randn(7, 3, generator=random, dtype=torch.float64) for _ in range(2)))
    positions, velocities = state.positions, state.velocities
    for _ in range(SUBSTEPS):
        velocities = velocities + SUBSTEP_TIME * GRAVITY
        positions = positions + SUBSTEP_TIME * velocities
    torch.testing.assert_close(state.ballistic(GRAVITY), (positions, velocities))


def test_the_lag_is_what_end_velocities_overstate_the_displacement_by():
    torch.testing.assert_close(free_fall_lag(GRAVITY), FRAME_TIME * (FRAME_TIME * GRAVITY) - free_fall(GRAVITY))


def test_a_detached_state_has_no_gradients():
    state = ParticleState(torch.ones(1, 3, requires_grad=True), torch.ones(1, 3, requires_grad=True)).detach()
    assert not state.positions.requires_grad and not state.velocities.requires_grad
