"""What a trajectory is worth beside another."""
