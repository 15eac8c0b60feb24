"""Sources of objects, cleaning, scaling, the train/test split (paper III)."""
