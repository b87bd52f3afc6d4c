"""The replays that a fit simulates with: the model itself, and a cheaper one for slopes."""

from __future__ import annotations

from forcegrasp.identify.problem import Problem
from forcegrasp.physics.gripper import Gripper
from forcegrasp.replay.replay import Replay

#: Step of the finite differences in a problem's coordinates: above contact noise, within the linear range; and one that
#: smooths the signals of a finger that sticks and slips.
STEP, LARGE_STEP = 0.02, 0.06


class Simulators:
    """The replays that a fit needs: the model itself, and a cheap one where larger steps or a fast tier make one.

    Slopes come from the cheap one, and values too, corrected by the difference of the two at a nearby point; so few
    evaluations of the model itself are needed, and what is fitted in the end is the model itself.

    Args:
      problem: whose grasps are simulated.
      exact: never use the cheap one.
    """

    def __init__(self, problem: Problem, exact: bool = False) -> None:
        gripper, grasps = problem.gripper, problem.grasps
        self.exact = Replay(gripper, grasps)
        cheap = "reference" if exact else cheap_tier(gripper)
        self.cheap = self.exact if cheap == "reference" else Replay(gripper, grasps, cheap)
        #: Where a fit of the model itself takes slopes from. With larger steps those of a scene whose joints rub led a
        #: fit along a flat valley; a sphere says that somebody compared them.
        self.at_the_end = self.exact if gripper.fast == "none" else self.cheap
        self.step = STEP  #: of the finite differences, in coordinates

    @property
    def one_model(self) -> bool:
        """Whether there is no cheap one: all that is simulated is the model itself."""
        return self.cheap is self.exact


def cheap_tier(gripper: Gripper, tier: str = "fitting") -> str:
    """Physics tier that is good enough for slopes, or as rough as another; that of the model where it isn't cheaper."""
    if gripper.own_steps:
        return "reference"
    steps = [gripper.compile(name).opt.timestep for name in (tier, "reference")]
    return "reference" if gripper.fast == "none" and steps[0] == steps[1] else tier
