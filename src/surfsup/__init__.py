"""Pour water on any surface: learned particle fluids whose solids are signed distance functions."""

__version__ = "0.1.0"
