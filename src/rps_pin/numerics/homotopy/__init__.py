"""Homotopy continuation: paths of solutions of complex systems, monodromy, and proofs of roots."""
