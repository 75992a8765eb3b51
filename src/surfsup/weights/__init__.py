"""The trained models that ship: safetensors, each with its card."""
