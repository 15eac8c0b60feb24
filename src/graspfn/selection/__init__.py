"""Choosing objects: sources of meshes, cleaning, scaling, the train/test split (paper IV-C, VII)."""
