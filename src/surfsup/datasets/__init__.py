"""Data sets: recipes of scenes, their generation, and the windows of frames that training reads."""
