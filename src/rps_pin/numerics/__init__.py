"""Numerical methods without robots: linear algebra with one rule of rank, quadratic programs.

Nothing here knows of mechanisms; `rps_pin.closed_loop` and `rps_pin.rps` build on it.
"""
