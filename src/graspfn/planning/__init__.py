"""From a grasp function to a pose: smoothing with Sigma, refinement, the Centroid baseline (paper VI, VII-A)."""
