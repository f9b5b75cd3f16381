"""Mechanisms from files: URDF, YAML descriptions and MJCF."""
