"""A mechanism in generated code: its functions, their proof, and the calls of a user."""
