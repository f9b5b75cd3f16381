"""Every assembly mode: all complex solutions of the closures, the real ones among them proven.

Three kinds of mechanisms have polynomial equations of their own (the joints with given values
stand):

- platforms on six legs between points (`six_leg_modes`): 40 solutions at most;
- platforms on three tips of legs with one hinge each (`three_tips`): 16 at most;
- planar mechanisms of hinges and slides (`planar_modes`): C(2 r, r) at most, r the number of
  independent turns.

All others of turns, slides and balls, with as many independent equations as unknowns, are
`general`: loops in complex places of the closed frames lead from one solution to the others,
until 16 loops in a row lead to no new one. Loops in these places permute the solutions
transitively. If each was a uniform draw from that group, 16 of them would keep a part of the
solutions to itself with a probability of 2^-16 at most. They are not such draws: that none is
missing is not proven.

Of the three kinds, as many paths are followed (`numerics.homotopy`). The most are proven; that none
was lost on its way is not: a path is followed by floating-point numbers. That each mode exists near
q, and that no two of them are the same, is proven by Krawczyk's test with outward rounding.
"""
