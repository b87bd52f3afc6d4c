"""Fits a gripper's parameters to measured grasps, and says what the fit leaves."""
