"""The reference solver SPlisHSPlasH, which runs in a child process."""
