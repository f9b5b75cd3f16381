"""Closed-form dynamics of the 3-RPS: actuator forces, reactions, loads and sizing."""
