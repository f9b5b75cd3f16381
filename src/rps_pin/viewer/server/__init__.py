"""Live views: a Meshcat server on this machine only."""
