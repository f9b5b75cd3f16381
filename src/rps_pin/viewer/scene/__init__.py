"""Scenes: links, shapes, stage and animation, in any Meshcat window."""
