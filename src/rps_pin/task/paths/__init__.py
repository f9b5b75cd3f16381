"""Paths of any mechanism with a task: signals along them, their zeros, and the events of a check.

`rps_pin.task.check_path` is where to begin.
"""
