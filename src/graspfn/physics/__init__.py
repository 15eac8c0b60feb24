"""DART: the gripper, the world, settling an object, one attempt, labelling a whole object (paper III-A, III-C)."""
