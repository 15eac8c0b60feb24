"""Depth images: rendering, the noise model, hole filling, the network's input (paper IV-B, V, VI)."""
