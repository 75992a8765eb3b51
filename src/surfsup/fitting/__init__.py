"""Fitting neural surfaces: a SIREN to one shape, a DeepSDF to many."""
