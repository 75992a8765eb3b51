"""The DFSPH solver: neighbor search, pressure solve, boundary handling, collision handling."""
