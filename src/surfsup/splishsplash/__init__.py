"""The reference solver SPlisHSPlasH, run in a child process."""
