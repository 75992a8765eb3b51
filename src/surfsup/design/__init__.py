"""Gradient-based shape optimization: parameters of a surface, optimized for where the water goes."""

from surfsup.design.optimize import optimize
from surfsup.design.paper.bowl import bowl
from surfsup.design.paper.funnel import funnel
from surfsup.design.parameter import Parameter
from surfsup.design.reward import Outcome, landing_near, near
from surfsup.design.run import DesignRun
from surfsup.design.task import Task
from surfsup.design.verification import verify

__all__ = ["DesignRun", "Outcome", "Parameter", "Task", "bowl", "funnel", "landing_near", "near", "optimize", "verify"]
