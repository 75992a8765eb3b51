"""Procedural solids: random chairs, a coral, a lion, a furnished room."""
