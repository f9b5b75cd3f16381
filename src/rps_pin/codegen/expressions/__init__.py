"""Expressions of a mechanism: its tree, its closures, its dynamics, in CasADi symbols."""
