"""Pictures, videos and web pages of trajectories, rendered from particle positions and a triangle mesh."""
