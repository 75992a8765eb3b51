"""Networks as signed distance functions: SIREN and DeepSDF."""
