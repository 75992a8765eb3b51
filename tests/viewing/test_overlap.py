import threading

import pytest

from surfsup.viewing.overlap import overlapped


def test_results_come_in_order_and_only_the_middle_stage_runs_in_the_callers_thread():
    here, others = threading.get_ident(), set()

    def elsewhere(value):
        others.add(threading.get_ident())
        return value + 1

    def draw(item, prepared):
        assert threading.get_ident() == here and prepared == item + 1
        return 10 * prepared

    assert list(overlapped(range(50), elsewhere, draw, elsewhere)) == [10 * (item + 1) + 1 for item in range(50)]
    assert here not in others
    assert list(overlapped([], elsewhere, draw, elsewhere)) == []


def test_items_are_taken_as_they_are_needed():
    taken = []

    def items():
        for item in range(1000):
            taken.append(item)
            yield item

    pictures = overlapped(items(), lambda item: item, lambda item, prepared: prepared, lambda drawn: drawn)
    assert next(pictures) == 0
    pictures.close()
    assert len(taken) < 40


@pytest.mark.parametrize("stage", range(3))
def test_an_error_of_any_stage_reaches_the_caller(stage):
    def fail(*values):
        raise ValueError("no water")

    stages = [lambda item: item, lambda item, prepared: prepared, lambda drawn: drawn]
    stages[stage] = fail
    with pytest.raises(ValueError, match="no water"):
        list(overlapped(range(5), *stages))
