"""Three stages of work overlap: the first and the last run in threads, the middle one in the caller's."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

Item = TypeVar("Item")
Prepared = TypeVar("Prepared")
Drawn = TypeVar("Drawn")
Result = TypeVar("Result")

_AHEAD = 8  # items that a stage may be ahead of the next


def overlapped(
    items: Iterable[Item],
    prepare: Callable[[Item], Prepared],
    draw: Callable[[Item, Prepared], Drawn],
    finish: Callable[[Drawn], Result],
) -> Iterator[Result]:
    """``finish(draw(item, prepare(item)))`` of each item, in order.

    VTK's windows belong to one thread, so ``draw`` runs in the caller's. At most a few items are in work at a time.
    """
    source = iter(items)
    with ThreadPoolExecutor(max(2, os.cpu_count() or 1)) as pool:
        prepared: deque[tuple[Item, Future[Prepared]]] = deque()
        finished: deque[Future[Result]] = deque()
        try:
            while True:
                for item in islice(source, _AHEAD - len(prepared)):
                    prepared.append((item, pool.submit(prepare, item)))
                if prepared:
                    item, future = prepared.popleft()
                    finished.append(pool.submit(finish, draw(item, future.result())))
                while finished and (not prepared or len(finished) > _AHEAD or finished[0].done()):
                    yield finished.popleft().result()
                if not prepared and not finished:
                    return
        finally:
            pool.shutdown(cancel_futures=True)
