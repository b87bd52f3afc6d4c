"""Compares policies on the same grasps: rollouts, tables, learning curves, plots and video."""
