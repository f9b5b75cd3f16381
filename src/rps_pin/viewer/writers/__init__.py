"""Front ends of a scene: Meshcat for pages and the live viewer, viser for the panel."""
