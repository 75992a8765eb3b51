"""Files: trajectories in HDF5 and the folder of one simulation."""
