"""Simulation on the manifold of closed configurations."""
