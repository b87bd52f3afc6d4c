"""Measured grasps simulated again, plans of grasps, and sets recorded from the simulator."""
