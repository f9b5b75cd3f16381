"""Closed configurations: closing the loops, projection, completion, joint limits."""
