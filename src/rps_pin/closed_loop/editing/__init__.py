"""Open trees from other trees: merge joints, split joints, compose trees."""
