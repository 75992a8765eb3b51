"""Trajectories in the formats of other programs: particles, water surfaces and the solid, at any frame rate."""
