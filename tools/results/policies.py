"""The policies that come with the package, and sweeps: a line each, from which training and tables follow."""

from __future__ import annotations

from dataclasses import dataclass

REWARD, MEASURED = "force_reward_normalised", "force_reward_measured"


@dataclass(frozen=True)
class Policy:
    """A policy that comes with the package.

    Args:
      options: of ``forcegrasp train``, but for the seed.
      what: it is, in a sentence of its card.
      of_robot: trained with the model that was found for the virtual robot, and judged on it.
      judged_by: the figure whose median decides which seed is shipped.
    """

    name: str
    options: str
    what: str
    of_robot: bool = False
    judged_by: str = REWARD

    @property
    def code(self) -> str:
        """The kind of its figures, a key of ``CODE``."""
        return "diagnosis" if self.of_robot else "training"


POLICIES = (
    Policy(
        "recommended",
        "experiment=recommended",
        "What to put on a robot (`experiment=recommended`): it sees ten frames, squeezes with both fingers alike,"
        " touches hard objects gently where little is asked for, pays for force beyond the goal, and learned from a"
        " teacher that knows how hard the object is.",
    ),
    Policy(
        "ib",
        "experiment=ib_tuned",
        "The paper's method, π^IB, as trained by `experiment=ib_tuned`: force reward in the authors' form, and a finger"
        " that waits for the other does not move (φ = 0).",
    ),
    Policy(
        "no_ib",
        "experiment=no_ib reward=goal_normalised",
        "The paper's first ablation, π^NO-IB: no inductive bias. Force reward in the authors' form, as for `ib`.",
    ),
    Policy(
        "no_rand",
        "experiment=no_rand reward=goal_normalised",
        "The paper's second ablation, π^NO-RAND: neither inductive bias nor domain randomisation. Force reward in the"
        " authors' form, as for `ib`.",
    ),
    Policy(
        "ib_virtual_robot",
        "experiment=ib_tuned",
        "As `ib`, but trained with the effects that `forcegrasp diagnose` found in measurements of the virtual robot"
        " (docs/transfer.md): the model is what that page's commands write.",
        of_robot=True,
    ),
    Policy(
        "ib_virtual_robot_measured",
        "experiment=ib_tuned reward.forces=measured",
        "As `ib_virtual_robot`, but its reward judged what the sensors say (`reward.forces=measured`), as a robot's own"
        " force reward does.",
        of_robot=True,
        judged_by=MEASURED,
    ),
)


@dataclass(frozen=True)
class Sweep:
    """Experiments that a page has a table of.

    Args:
      options: of ``forcegrasp train -m``, but for the seeds.
      beside: policies that stand in its table, too; their own seeds do.
    """

    options: str
    beside: tuple[str, ...] = ()


_AS_SHIPPED = "reward=goal_normalised action.bias_one_contact=0"
SWEEPS = {
    "ablation": Sweep(f"experiment=no_curriculum {_AS_SHIPPED}", ("ib", "no_ib", "no_rand")),
    "parts": Sweep(f"experiment=no_noise,no_stacking,no_had_contact,no_last_action {_AS_SHIPPED}", ("ib",)),
    "printed": Sweep("experiment=ib,no_ib,no_rand ppo.discount=0.99"),
}
#: Controllers that stand beside them.
CONTROLLERS = ("force_pi", "informed")
