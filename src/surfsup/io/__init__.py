"""Files: trajectories in HDF5 and the output folder of a simulation."""
