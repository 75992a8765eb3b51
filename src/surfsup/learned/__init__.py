"""Learned simulators: graph networks, and networks that correct the SPH solver."""
