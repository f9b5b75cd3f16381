"""Motions of tasks, sample by sample: forces, reactions, forces by cause, and demands on actuators.

`rps_pin.task.size_trajectory` is where to begin.
"""
