"""The learned simulator."""
