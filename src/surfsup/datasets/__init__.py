"""Data sets: which scenes, their making, and what training reads of them."""
