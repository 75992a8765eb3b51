import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import surfsup.gym
from surfsup.gym.pour import CUP_HEIGHT, CUP_PLACE, HEIGHT, MAX_TILT, inside_vessel

FULL_TILT, STILL, BACK = (np.array(action, np.float32) for action in ((1, 0), (0, 0), (-1, 0)))


@pytest.fixture(scope="module")
def made():
    return gymnasium.make(surfsup.gym.POUR, render_mode="rgb_array")


@pytest.fixture
def pour(made):
    made.reset(seed=0, options={"target": 0.5})
    return made


def test_it_passes_gymnasiums_own_check(made):
    check_env(made.unwrapped, skip_render_check=True)


def test_a_cup_that_stands_still_spills_nothing_and_gains_nothing(pour):
    for _ in range(5):
        observation, reward, terminated, truncated, info = pour.step(STILL)
        assert reward == pytest.approx(0, abs=1e-6)
        assert (terminated, truncated) == (False, False)
    assert (info["shares"].cup, info["shares"].spilled) == (1.0, 0.0)
    assert info["time"] == pytest.approx(0.2, rel=0.05)
    assert observation in pour.observation_space


def test_tilting_pours_and_the_rewards_add_up_to_the_change_of_the_cost(pour):
    total = 0.0
    for number in range(60):
        _, reward, _, _, info = pour.step(FULL_TILT if number < 40 else BACK)
        total += reward
    shares = info["shares"]
    assert shares.cup < 0.2
    assert shares.cup + shares.glass + shares.spilled + shares.air == pytest.approx(1)
    assert total == pytest.approx(0.5 - (abs(0.5 - shares.glass) + 2 * shares.spilled))


def test_a_seed_draws_the_target_and_gives_the_same_episode(made):
    def episode(seed):
        first, info = made.reset(seed=seed)
        return info["target"], [first, *(made.step(FULL_TILT)[0] for _ in range(12))]

    target, observations = episode(3)
    again, repeated = episode(3)
    assert target == again
    np.testing.assert_array_equal(observations, repeated)
    assert episode(4)[0] != target


def test_a_state_can_be_returned_to(pour):
    world = pour.unwrapped
    for _ in range(10):
        pour.step(FULL_TILT)
    state = world.state
    one = [pour.step(FULL_TILT)[:2] for _ in range(5)]
    world.set_state(state)
    for (observation, reward), (repeated, again) in zip(one, [pour.step(FULL_TILT)[:2] for _ in range(5)], strict=True):
        np.testing.assert_array_equal(observation, repeated)
        assert reward == again


def test_the_tilt_is_bounded_and_the_cup_turns_about_its_middle(pour):
    for _ in range(60):
        observation = pour.step(FULL_TILT)[0]
    assert observation[0] == 1
    pose = pour.unwrapped.simulation.frame.poses["cup"]
    middle = pose.apply(np.array([[0, 0, HEIGHT / 2]]))[0]
    np.testing.assert_allclose(middle, [CUP_PLACE, 0, CUP_HEIGHT + HEIGHT / 2], atol=1e-6)
    up = pose.apply(np.array([[0, 0, 1.0]]))[0] - pose.position
    assert np.degrees(np.arccos(up[2])) == pytest.approx(np.degrees(MAX_TILT), abs=0.01)
    assert up[0] > 0  # toward the glass


def test_the_inside_of_a_vessel():
    points = np.array([[0, 0, 0.1], [0.074, 0, 0.1], [0.08, 0, 0.1], [0, 0, 0.21], [0, 0, -0.01]])
    assert inside_vessel(points).tolist() == [True, True, False, False, False]


def test_a_picture_of_the_present_frame(pour):
    image = pour.render()
    assert (image.shape, image.dtype) == ((360, 480, 3), np.uint8)
    assert image.std() > 10
    pour.step(FULL_TILT)
    assert np.abs(pour.render().astype(int) - image).max() > 50
    pour.close()
