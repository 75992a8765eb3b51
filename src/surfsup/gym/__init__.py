"""Environments of Gymnasium: tasks with water for reinforcement learning; importing this package registers them."""

from __future__ import annotations

from surfsup.errors import InputError

try:
    import gymnasium
except ModuleNotFoundError:
    raise InputError("Gymnasium is not installed: pip install 'surfsup[gym]'") from None

POUR = "surfsup/Pour-v0"
POUR_STEPS = 100  # of 40 ms

gymnasium.register(POUR, entry_point="surfsup.gym.pour:Pour", max_episode_steps=POUR_STEPS)
