"""How much better than given policies anybody could do, on grasps by a robot whose model is known.

    forcegrasp robot 2                                # robot_2.yaml
    python tools/attainable.py robot_2.yaml runs/perfect_2 ib force_pi [--grasps 20] [--rounds 25] [--tries 64]

Each policy grasps the same objects; noise of the sensors is left out. Then, grasp by grasp, the actions of the best of
them are changed by smooth random amounts, and what earns more is gone on from (cross-entropy method): that knows all
that happens beforehand, which no policy does. What it comes to is attainable; more may be.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import Any, cast

import numpy as np
import torch
from rich.console import Console
from rich.progress import track
from rich.table import Table
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase

from forcegrasp.config import ActionConfig, GraspConfig, PhysicsConfig, SensorConfig
from forcegrasp.env.reward import normalised_force_reward
from forcegrasp.errors import ForcegraspError
from forcegrasp.evaluate.grids import kappa_grid
from forcegrasp.evaluate.policies import load_policies
from forcegrasp.evaluate.rollouts import BATCH, roll_out
from forcegrasp.physics import GraspParameters
from forcegrasp.physics.completion import complete
from forcegrasp.physics.gripper import Gripper

#: Softness values among the grasps.
KAPPAS = 5
#: When changes begin to differ, seconds after the first touch: most is lost between it and a settled force.
KNOTS_S = (-0.4, -0.2, -0.08, 0.0, 0.08, 0.16, 0.28, 0.44, 0.8, 1.6, 3.2)
# Deviation of the changes at first, in units of the action, and least; share of the tries that are gone on from, and by
# how much the next round follows these.
_LARGE, _SMALL, _ELITE, _FOLLOW = 0.3, 0.005, 0.125, 0.7


class Playback(TensorDictModuleBase):
    """Plays actions ``(n, steps, motors)``, whatever is observed."""

    def __init__(self, actions: np.ndarray) -> None:
        super().__init__()
        self.in_keys, self.out_keys = ["joint_position"], ["action"]
        self._actions, self._step = torch.as_tensor(actions, dtype=torch.float32), 0

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        self._step += 1
        return tensordict.set("action", self._actions[:, self._step - 1])


class Grasping:
    """Grasps of a gripper with a model, without noise.

    Args:
      gripper: that grasps.
      model: file of its model.
      tier: of the physics.
    """

    def __init__(self, gripper: Gripper, model: str, tier: str) -> None:
        self.gripper, self.config = gripper, complete(GraspConfig(), gripper)
        still = SensorConfig(position_std_m=0.0, force_std_n=0.0)
        self._parts: dict[str, Any] = {
            "gripper": gripper,
            "model": model,
            "physics": PhysicsConfig(tier=tier),
            "sensors": still,
        }

    def grasps(self, count: int) -> GraspParameters:
        """So many of them, of evenly spread softness; all else random."""
        return kappa_grid(self.config, KAPPAS, -(-count // KAPPAS), 0, self.gripper).grasps

    def episodes(self, policy: TensorDictModuleBase, grasps: GraspParameters, **parts: Any) -> TensorDictBase:
        """A whole episode of each grasp."""
        return roll_out(policy, grasps, self.config, **self._parts, **parts)

    def moved(self, episodes: TensorDictBase) -> np.ndarray:
        """Actions ``(n, steps, motors)`` that do what was done, whatever rules changed a policy's own."""
        largest = complete(ActionConfig(), self.gripper).max_delta_m
        commanded, position = _values(episodes, "commanded_position"), episodes["measured_position"].numpy()
        return np.clip((commanded - position) / largest, -1, 1)

    def played(self, actions: np.ndarray, grasps: GraspParameters) -> np.ndarray:
        """Rewards of actions ``(n, steps, motors)``, by what the sensors say, ``(n,)``."""
        return rewards(self.playback(actions, grasps))

    def playback(self, actions: np.ndarray, grasps: GraspParameters) -> TensorDictBase:
        """Episodes of actions ``(n, steps, motors)``."""
        parts = [slice(first, first + BATCH) for first in range(0, len(grasps), BATCH)]
        plain, every = ActionConfig(inductive_bias=False), np.arange(len(grasps))
        played: Any = [self.episodes(Playback(actions[p]), grasps[every[p]], action=plain) for p in parts]
        return cast(TensorDictBase, torch.cat(played))


def _values(episodes: TensorDictBase, entry: str) -> np.ndarray:
    """What an entry is after each step, ``(n, steps, …)``."""
    values: Any = episodes["next", entry]
    return values.numpy()


def rewards(episodes: TensorDictBase) -> np.ndarray:
    """Force reward of each episode by what the sensors say, in the normalised form, ``(n,)``."""
    force, goal = episodes["next", "measured_force"], episodes["next", "goal_force"]
    return normalised_force_reward(goal - force, goal).sum((1, 2)).numpy()


def improved(
    grasping: Grasping, grasps: GraspParameters, actions: np.ndarray, rounds: int, tries: int, seed: int = 0
) -> Iterator[np.ndarray]:
    """After each round the best rewards so far, ``(n,)``, of smooth changes of actions ``(n, steps, motors)``."""
    n, steps, motors = actions.shape
    begun = grasping.playback(actions, grasps)
    shapes = _shapes(_first_touch(begun), steps, grasping.gripper.period_s)
    rng, elite = np.random.default_rng(seed), max(2, round(_ELITE * tries))
    mean, std = np.zeros((n, len(KNOTS_S), motors)), np.full((n, len(KNOTS_S), motors), _LARGE)
    best, most = mean.copy(), rewards(begun)
    each = np.repeat(np.arange(n), tries)
    for _ in range(rounds):
        tried = mean[:, None] + std[:, None] * rng.standard_normal((n, tries, *mean.shape[1:]))
        tried[:, 0] = best
        changed = actions[:, None] + np.einsum("ntk,njkm->njtm", shapes, tried)
        earned = grasping.played(np.clip(changed, -1, 1).reshape(-1, steps, motors), grasps[each]).reshape(n, tries)
        order = np.argsort(-earned, axis=1)[:, :elite]
        good = np.take_along_axis(tried, order[:, :, None, None], axis=1)
        more = np.take_along_axis(earned, order, axis=1)[:, 0]
        best = np.where((more > most)[:, None, None], good[:, 0], best)
        most = np.maximum(most, more)
        mean = (1 - _FOLLOW) * mean + _FOLLOW * good.mean(axis=1)
        std = np.maximum((1 - _FOLLOW) * std + _FOLLOW * good.std(axis=1), _SMALL)
        yield most


def _first_touch(episodes: TensorDictBase) -> np.ndarray:
    """The step in which something is touched first, ``(n,)``; the last one if nothing is."""
    touched = _values(episodes, "force").max(axis=-1) > 0
    return np.where(touched.any(axis=-1), touched.argmax(axis=1), touched.shape[1] - 1)


def _shapes(touch: np.ndarray, steps: int, period_s: float) -> np.ndarray:
    """What each knot does to each step, ``(n, steps, knots)``: straight lines from knot to knot."""
    identity = np.eye(len(KNOTS_S))
    after = (np.arange(steps) - touch[:, None]) * period_s
    return np.stack([np.interp(after, KNOTS_S, one) for one in identity], axis=-1)


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", help="file of the robot's model")
    parser.add_argument("policies", nargs="+", help="controllers, shipped policies or run folders")
    parser.add_argument("--grasps", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--tries", type=int, default=64, help="of each grasp in a round")
    parser.add_argument("--tier", default="fast", choices=("reference", "fast"))
    given, console = parser.parse_args(arguments), Console()
    torch.set_num_threads(1)
    try:
        policies = load_policies(given.policies)
        grasping = Grasping(policies[0].gripper, given.model, given.tier)
        grasps = grasping.grasps(given.grasps)
        table = Table("", "force reward, measured", "of what is attainable")
        earned, actions = {}, {}
        for one in policies:
            episodes = grasping.episodes(one.policy, grasps, action=one.action, observation=one.observation)
            earned[one.name], actions[one.name] = rewards(episodes), grasping.moved(episodes)
    except ForcegraspError as error:
        raise SystemExit(f"error: {error}") from None
    best = np.argmax(list(earned.values()), axis=0)
    begun = np.stack(list(actions.values()))[best, np.arange(len(best))]
    rounds = improved(grasping, grasps, begun, given.rounds, given.tries)
    *_, most = track(rounds, "looking for more", given.rounds, console=console)
    for name, reward in {**earned, "attainable": most}.items():
        table.add_row(name, f"{reward.mean():.1f}", f"{reward.mean() / most.mean():.0%}")
    console.print(table)


if __name__ == "__main__":
    main()
