"""Robot recordings in MCAP: written by a simulated robot, read and analysed whoever wrote them (paper VII-B)."""
