"""Frames, the camera, the pose grid Q, and moving images and grasp functions about."""
