"""DART: the gripper, the world, settling an object, one attempt, labelling a whole object (paper IV-A, IV-C)."""
