"""Simulated trials and the statistics of their outcomes (paper VII-A)."""
