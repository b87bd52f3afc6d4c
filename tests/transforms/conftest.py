"""A cheap environment with the keys that the transforms read, and a way to play given actions in any environment."""

from __future__ import annotations

from collections.abc import Callable
from math import prod

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

SURFACE_M, STIFFNESS_N_PER_M = 0.03, 100.0
OBSERVATIONS = {
    "joint_position": 2,
    "measured_position": 2,
    "force": 2,
    "measured_force": 2,
    "force_gap": 2,
    "touching": 2,
    "goal_force": 1,
    "received": 2,
}


class FakeGrasp(EnvBase):
    """Two fingers against springs. A row's episode ends after ``steps`` to ``steps + 2`` steps, so resets are partial.

    ``received`` is the delta of the last step, as it arrived here. ``forces`` ``(T, *batch, 2)`` replaces the springs;
    it is read at the row's age. ``bounded`` says in the specs that force and reward are not negative.
    """

    def __init__(
        self,
        batch: tuple[int, ...] = (3,),
        *,
        seed: int = 0,
        steps: int = 4,
        forces: Tensor | None = None,
        dtype: torch.dtype = torch.float32,
        bounded: bool = False,
    ) -> None:
        super().__init__(device="cpu", batch_size=batch)
        self.rows, self.dtype_ = prod(batch), dtype
        self.steps = steps
        self.forces = None if forces is None else forces.reshape(-1, self.rows, 2).to(dtype)
        self.age, self.last_step = (torch.zeros(self.rows, dtype=torch.long) for _ in range(2))
        self.position, self.received = (torch.zeros(self.rows, 2, dtype=dtype) for _ in range(2))
        self.goal = torch.ones(self.rows, 1, dtype=dtype)
        self.set_seed(seed)

        def free(size: int) -> Unbounded:
            return Unbounded(shape=(*batch, size), dtype=dtype)

        def positive(size: int) -> Bounded:
            return Bounded(0, 100, shape=(*batch, size), dtype=dtype)

        flag = Categorical(2, shape=(*batch, 1), dtype=torch.bool)
        delta = Bounded(-0.045, 0.045, shape=(*batch, 2), dtype=dtype)
        self.action_spec = Composite(joint_delta=delta, shape=batch)
        self.observation_spec = Composite({key: free(size) for key, size in OBSERVATIONS.items()}, shape=batch)
        self.reward_spec = positive(1) if bounded else free(1)
        if bounded:
            self.observation_spec["force"] = positive(2)
            self.observation_spec["measured_force"] = positive(2)
        done = {key: flag.clone() for key in ("done", "truncated", "terminated")}
        self.full_done_spec = Composite(done, shape=batch)

    def _set_seed(self, seed: int | None) -> None:
        self.rng = torch.Generator().manual_seed(seed or 0)

    def _reset(self, tensordict: TensorDictBase | None = None, **kwargs) -> TensorDict:
        mask = None if tensordict is None else tensordict.get("_reset", None)
        rows = torch.ones(self.rows, dtype=torch.bool) if mask is None else mask.reshape(-1)
        draws = torch.rand(int(rows.sum()), 3, generator=self.rng, dtype=self.dtype_)
        self.position[rows], self.goal[rows] = 0.028 + 0.006 * draws[:, :2], 0.1 + 0.4 * draws[:, 2:]
        self.received[rows], self.age[rows] = 0.0, 0
        self.last_step[rows] = self.steps + torch.randint(3, (len(draws),), generator=self.rng)
        return self._state()

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        self.received = tensordict.get("joint_delta").reshape(-1, 2).clone()
        self.position = self.position + self.received
        self.age += 1
        state = self._state()
        return state.set("reward", state.get("force").sum(-1, keepdim=True))

    def _state(self) -> TensorDict:
        force = STIFFNESS_N_PER_M * (SURFACE_M - self.position).clamp_min(0)
        if self.forces is not None:
            force = self.forces[self.age, torch.arange(self.rows)]
        truncated = (self.age >= self.last_step).unsqueeze(-1)
        state = {
            "joint_position": self.position,
            "measured_position": self.position,
            "force": force,
            "measured_force": force,
            "force_gap": self.goal - force,
            "touching": (force > 0).to(self.dtype_),
            "goal_force": self.goal,
            "received": self.received,
            "done": truncated,
            "truncated": truncated,
            "terminated": torch.zeros_like(truncated),
        }
        batch = self.batch_size
        return TensorDict({key: value.clone().reshape(*batch, -1) for key, value in state.items()}, batch_size=batch)


def play_actions(env: EnvBase, actions: Tensor) -> TensorDict:
    """Plays ``actions`` ``(T, *batch, 2)``, through the resets of rows that end. Returns batch ``(*batch, T)``."""
    given = iter(actions)

    def policy(tensordict: TensorDictBase) -> TensorDictBase:
        return tensordict.set(env.action_key, next(given).clone())

    with torch.no_grad():
        return env.rollout(len(actions), policy, break_when_any_done=False, return_contiguous=True)


def random_actions(steps: int, *batch: int, size: float = 1.5, seed: int = 0) -> Tensor:
    """Actions ``(steps, *batch, 2)``, uniform in ±size: beyond the policy's ±1 unless told otherwise."""
    draws = torch.rand(steps, *batch, 2, generator=torch.Generator().manual_seed(seed))
    return size * (2 * draws - 1)


# session-wide, because hypothesis refuses fixtures that are made anew for every test
@pytest.fixture(scope="session")
def fake_grasp() -> type[FakeGrasp]:
    return FakeGrasp


@pytest.fixture(scope="session")
def play() -> Callable[[EnvBase, Tensor], TensorDict]:
    return play_actions


@pytest.fixture(scope="session")
def actions() -> Callable[..., Tensor]:
    return random_actions
