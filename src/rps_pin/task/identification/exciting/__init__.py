"""Motions in which a log tells most: Fourier series, and the search for the best of them."""
