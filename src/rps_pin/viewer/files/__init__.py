"""Files of a scene: pages, pictures and films."""
