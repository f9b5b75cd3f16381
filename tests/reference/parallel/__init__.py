"""Parallel robots of urdf/ in closed form: inverse kinematics, bodies, direct kinematics."""
