"""A mechanism in generated CUDA for NVIDIA's cards: source, launches, and proof on the card."""
