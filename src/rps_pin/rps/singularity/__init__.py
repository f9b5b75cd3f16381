"""Singularities of the 3-RPS: measures at a pose, and along a path."""
