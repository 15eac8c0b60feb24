"""Learning the grasp function: augmentation, networks, training (paper IV, V)."""
