"""The DFSPH solver in NVIDIA Warp: with gradients, in single and double precision, on CPUs and GPUs."""
