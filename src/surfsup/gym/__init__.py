"""Environments of Gymnasium: tasks with water for reinforcement learning.

They are registered when gymnasium is imported, or by ``import surfsup.gym``.
"""

from __future__ import annotations

POUR = "surfsup/Pour-v0"
POUR_STEPS = 100  # of 40 ms


def register() -> None:
    """Register the environments; gymnasium calls it through its entry point ``gymnasium.envs``."""
    import gymnasium

    if POUR not in gymnasium.registry:
        gymnasium.register(POUR, entry_point="surfsup.gym.pour:Pour", max_episode_steps=POUR_STEPS)
