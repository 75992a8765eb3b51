"""The kernels, for each precision.

A function for each group of kernels returns them for a precision; all of a group are compiled together. Annotations in
these modules are read by Warp, so ``from __future__ import annotations`` is left out and type checkers skip them.
"""
