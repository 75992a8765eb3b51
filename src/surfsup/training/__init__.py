"""Training of learned simulators: configuration, batches, objectives, validation."""
