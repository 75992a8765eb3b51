"""What training and fitting share: optimizer, learning-rate schedule, checkpoints, stopping."""
