"""Rigid bodies that water, gravity and contacts move."""
