"""Ground truth by SPlisHSPlasH, run in a child process."""
