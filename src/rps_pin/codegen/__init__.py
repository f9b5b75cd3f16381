"""Generated code: a mechanism as CasADi expressions, as C99, and as machine code."""
