"""The bounds of the energy limiter, in C++ and in Warp alike."""

MAX_ENERGY_GAIN = 2e-3  # J/kg in a frame; valid rollouts gain this now and then, and a scene begins with 5 to 15
MAX_DELTA_VELOCITY = 5.0  # m/s in a frame; one true change in ten thousand exceeds 4.7
HALVINGS = 10
