"""Solids that the project makes itself: chairs, a coral, a lion, a furnished room."""
