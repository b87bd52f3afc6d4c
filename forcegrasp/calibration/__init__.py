"""How the paper tuned its simulator (appendix): power grasps, contact stiffness, staircase of final forces."""

from forcegrasp.calibration.power_grasp import closing_speed, power_grasps
from forcegrasp.calibration.power_grasp_fit import PowerGraspFit, fit_power_grasp
from forcegrasp.calibration.rig import Closing, close
from forcegrasp.calibration.staircase import Slope, Staircase, match_force_scale, regress, staircase
from forcegrasp.calibration.stiffness import contact_slope, vary_kappa, vary_rho

__all__ = [
    "Closing",
    "PowerGraspFit",
    "Slope",
    "Staircase",
    "close",
    "closing_speed",
    "contact_slope",
    "fit_power_grasp",
    "match_force_scale",
    "power_grasps",
    "regress",
    "staircase",
    "vary_kappa",
    "vary_rho",
]
