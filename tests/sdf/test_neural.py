from concurrent.futures import ThreadPoolExecutor

import pytest
import torch

from surfsup.sdf.neural import FEW, NeuralSurface

BALL = torch.tensor([[-0.5] * 3, [0.5] * 3])


class Counting(NeuralSurface):
    """A ball that writes down with how many of torch's threads it was asked."""

    def __init__(self) -> None:
        super().__init__(BALL, None)
        self.threads: list[int] = []

    def value(self, points: torch.Tensor) -> torch.Tensor:
        self.threads.append(torch.get_num_threads())
        return torch.linalg.vector_norm(points, dim=-1) - 0.5

    def field(self, points: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        return self.value(points), points


@pytest.fixture(autouse=True)
def two_threads():
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


@pytest.mark.parametrize(("count", "threads"), [(1, 1), (FEW, 1), (FEW + 1, 2)])
def test_few_points_are_asked_in_one_thread(count, threads):
    ball, points = Counting(), torch.ones(count, 3)
    ball.distance(points)
    ball.distance_and_normal(points)
    assert ball.threads == [threads, threads]
    assert torch.get_num_threads() == 2


def test_what_records_gradients_keeps_all_threads():
    ball, points = Counting(), torch.ones(3, 3, requires_grad=True)
    ball.distance(points).sum().backward()
    ball.distance_and_normal(points)
    assert ball.threads == [2, 2]


def test_the_threads_are_there_again_after_an_error():
    class Broken(Counting):
        def value(self, points: torch.Tensor) -> torch.Tensor:
            raise RuntimeError

    with pytest.raises(RuntimeError):
        Broken().distance(torch.ones(3, 3))
    assert torch.get_num_threads() == 2


def test_callers_in_several_threads_leave_them_as_they_were():
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda _: Counting().distance(torch.ones(3, 3)), range(200)))
    assert torch.get_num_threads() == 2
