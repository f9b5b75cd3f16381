"""Loop closures: their kinds, their rows, and the derivatives of the rows."""
