"""Readers of mesh files, one a format: memory-safe, in double precision, and without silence about what they skip."""
