"""The 3-RPS as generated code: kernels on CasADi expressions, and the loops around them in C.

The formulas are those of `rps_pin.rps.kernels`. CasADi is imported when a function here is called.
"""
