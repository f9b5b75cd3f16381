"""The formulas of the 3-RPS, each once, as functions of numbers.

A kernel takes and returns numbers and tuples of numbers: floats, NumPy arrays (one entry a sample),
complex numbers (derivatives by complex step) or CasADi expressions. There are no shapes, checks or
objects; those stand around the kernels, in `rps_pin.rps.kinematics` and `rps_pin.rps.dynamics`.
Ticks of control loops are generated from them (see `rps_pin.control.generated`).

- `tilt_functions`: the coefficients of the rotation, of Stumpff functions
- `platform`: rotation, quaternion, angular velocity and acceleration, rigid-body wrench
- `tips`: the spherical joints, their slopes, rates and accelerations
- `legs`: length, direction, rates, the cone of the spherical joint
- `limits`: the tolerance of limits
- `leg_equations`: Eq. 8, its slopes, Newton's step
- `continuation`: an assembly mode followed while the leg lengths change
- `placement`: centre, axes and tilt from the tips
- `forces`: virtual work of legs and platform, and its solution
"""
