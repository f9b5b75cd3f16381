"""Closed-form kinematics of the 3-RPS: poses, legs, assembly modes and rates."""
