"""Grippers that come with the package, and what was tried with them. See each file."""

#: The paper's gripper: what is simulated where no other is asked for.
DEFAULT_GRIPPER = "tiago"
