"""The bounds of the energy limiter, in C++ and in Warp alike."""

MAX_ENERGY_GAIN = 2e-2  # J/kg in a frame; water 1.3 m deep that comes to rest gains 0.014, a scene begins with 5 to 15
MAX_DELTA_VELOCITY = 5.0  # m/s in a frame; one true change in ten thousand exceeds 4.7
HALVINGS = 10
