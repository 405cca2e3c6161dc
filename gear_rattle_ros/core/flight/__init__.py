"""The flight between impacts, the impact law and the trajectories made of both."""
