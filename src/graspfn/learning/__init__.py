"""Learning the grasp function: networks and training, augmentation and pre-training (paper V, VII)."""
