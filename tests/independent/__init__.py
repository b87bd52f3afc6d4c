"""An independent rig: records measurement sets with hidden physical effects. Nothing here imports forcegrasp."""
