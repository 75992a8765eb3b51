"""The neural surfaces that ship: safetensors, each with its card."""
