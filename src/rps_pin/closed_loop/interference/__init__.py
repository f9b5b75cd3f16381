"""Interference of links: collision shapes, the pairs that are checked, and their distances.

`ClosedLoopModel.interference` is where to begin. Nothing here exerts a force: there is no contact.
"""
