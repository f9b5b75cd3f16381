"""Inverse and forward dynamics, their derivatives, passive joint forces and redundancy."""
