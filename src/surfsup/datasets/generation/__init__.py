"""Generating data sets: scenes of a recipe, simulated by the reference solver, side by side."""
