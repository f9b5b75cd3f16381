"""Motions of the 3-RPS: trajectory files, and shortest times along a curve."""
