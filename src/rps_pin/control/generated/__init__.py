"""Ticks of control loops as generated code, made from the functions of the interpreted ticks.

- `tick`: a regular tick as expressions and C
- `engine`: building and calling it
- `proof`: what is compared before it is used

A *regular* tick is one without refusals: a good reading after a good one, a valid target, forces
within their limits, far from singularities. Generated code computes these alone. Of any other it
changes nothing, and the interpreted tick answers; so there is one definition of each rare case.
"""
