"""Solids that the project makes itself, as fine as scanned ones: a coral, a lion, a furnished room."""
