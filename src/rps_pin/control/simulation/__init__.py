"""Simulated closed loops: plant, encoders, faults, scenarios and reports."""
