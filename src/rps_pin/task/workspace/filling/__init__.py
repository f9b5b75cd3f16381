"""How a grid is filled from a start: block by block, each block in fronts from its seeds.

What is computed of a configuration is in `rps_pin.task.workspace.evaluate`.
"""
