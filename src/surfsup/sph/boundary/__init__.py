"""Boundary handling: volume maps of solids, and the walls of the container."""
