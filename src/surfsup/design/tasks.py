"""The design tasks that `surfsup design` knows, by name."""

from __future__ import annotations

from collections.abc import Callable

from surfsup.design.bowl import bowl
from surfsup.design.funnel import funnel
from surfsup.design.task import Task

VESSELS: dict[str, Callable[..., Task]] = {"bowl": bowl, "funnel": funnel}
