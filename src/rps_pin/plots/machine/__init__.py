"""Figures of a machine as it is built."""
