"""The reproduction of the paper: its equations, figures and tables beside ours, as one page.

``rps-pin reproduce`` writes it. The formulas typed here are the paper's, misprints included, to be
compared; what the library itself uses stands in `rps_pin.rps` and `rps_pin.trajectories`.
"""
