"""Training: configuration, loss, the loop."""
