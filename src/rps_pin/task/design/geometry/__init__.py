"""What dimensions change of a mechanism: points, rods between them, bodies."""
