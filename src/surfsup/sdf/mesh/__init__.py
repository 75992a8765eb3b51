"""Triangle meshes as signed distance functions."""
