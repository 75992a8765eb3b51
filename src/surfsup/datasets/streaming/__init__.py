"""Scenes simulated while training runs, and the training windows of them."""
