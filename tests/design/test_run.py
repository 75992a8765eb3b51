from surfsup.design.record import PATIENCE
from tests.design.test_task import ball_task, climb, run_of


def away(end):
    """A reward that grows as the water leaves to one side."""
    return -end.positions[:, 0].mean()


class TestARun:
    def test_ends_when_nothing_is_gained_any_more(self, simulator, tmp_path):
        run = run_of(ball_task(height=0.2, reward=away), simulator, tmp_path)
        run.rewards = [0.0, 0.5, 1.0]
        assert not run.settled
        run.rewards += [0.9] * (PATIENCE - 1)
        assert not run.done
        run.rewards.append(1.0001)
        assert run.settled and run.done
        run.rewards[-1] = 1.1
        assert not run.settled

    def test_climbs(self, simulator, tmp_path):
        run = climb(run_of(ball_task(height=0.2, reward=away), simulator, tmp_path, iterations=4))
        assert run.done and len(run.rewards) == 5
        assert run.rewards[-1] > run.rewards[0] and run.best > 0

    def test_offers_a_remedy_when_that_happens_often(self, simulator, tmp_path):
        run = climb(run_of(ball_task(height=0.2, reward=away), simulator, tmp_path, iterations=2))
        assert run.remedy() is None
        run.ascent.cut = 2
        assert "fewer --frames" in run.remedy() and "--smooth" in run.remedy()
