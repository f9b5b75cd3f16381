"""Every assembly mode: all complex solutions of the closures, the real ones among them proven.

Three kinds of mechanisms are formulated as polynomials (the joints with given values stand):

- platforms on six legs between points (`six_leg_modes`): 40 solutions at most;
- platforms on three tips of legs with one hinge each (`three_tips`): 16 at most;
- planar mechanisms of hinges and slides (`planar_modes`): C(2 r, r) at most, r the number of
  independent turns.

As many paths are followed (`numerics.homotopy`). The most are proven; that none was lost on its way
is not: a path is followed by floating-point numbers. That each mode exists near q, and that no two
of them are the same, is proven by Krawczyk's test with outward rounding.
"""
