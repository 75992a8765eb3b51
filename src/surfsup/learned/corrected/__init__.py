"""A network on top of the DFSPH solver."""
