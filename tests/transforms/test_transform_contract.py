"""What torchrl's TransformBase asks of a transform, asked of each of ours alone and of all as build_env stacks them.

Two obligations more: resets of single rows leave the others alone, and what is random can be repeated and continued.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from unittest import mock

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule
from torch import Tensor, nn
from torchrl.data import LazyTensorStorage, ReplayBuffer
from torchrl.envs import EnvBase, ParallelEnv, SerialEnv, TransformedEnv, check_env_specs
from torchrl.envs.transforms import CatFrames, Compose, Transform
from torchrl.envs.utils import step_mdp

from forcegrasp import transforms as ours
from forcegrasp.config import GraspConfig, PhysicsConfig, SensorConfig
from forcegrasp.env import build, build_env
from forcegrasp.transforms import (
    ActionChangePenalty,
    ActionScale,
    ForceError,
    HadContact,
    InductiveBias,
    LastAction,
    ObservationNoise,
    TouchForce,
)

WORKERS, STEPS = 2, 9  # long enough for every row to end once
REFUSAL = "needs the step before: append it to an environment"
MEMORY = (HadContact, TouchForce, LastAction, ActionChangePenalty)
INVERSE = (InductiveBias, ActionScale)

ALONE = {
    "ObservationNoise": lambda: ObservationNoise(
        ["joint_position", "force"], ["sensed_position", "sensed_force"], [1e-4, 0.02], seed=3
    ),
    "ObservationNoise in place": lambda: ObservationNoise(["force"], ["force"], [0.02]),
    "HadContact": lambda: HadContact(0.1, in_key="force"),
    "TouchForce": lambda: TouchForce(force_key="force", had_contact_key="touching"),
    "ForceError": lambda: ForceError(force_key="force"),
    "ForceError in place": lambda: ForceError(force_key="force", out_key="force"),
    "LastAction": lambda: LastAction(action_key="joint_delta"),
    "ActionChangePenalty": lambda: ActionChangePenalty(0.5, last_action_key="received"),
    "InductiveBias": lambda: InductiveBias(had_contact_key="touching", force_error_key="force_gap"),
    "ActionScale": lambda: ActionScale(0.003),
    "ActionScale in place": lambda: ActionScale(0.003, action_key="joint_delta"),
}
TOGETHER = {"paper": SensorConfig(), "paper without noise": SensorConfig(position_std_m=0.0, force_std_n=0.0)}


@dataclass(frozen=True)
class Case:
    """A transform under test. ``make`` returns a new one each time; ``delta`` is the size of sensible actions."""

    name: str
    make: Callable[[], Transform]

    @property
    def parts(self) -> list[Transform]:
        transform = self.make()
        return list(transform) if isinstance(transform, Compose) else [transform]

    def has(self, kinds: type | tuple[type, ...]) -> bool:
        return any(isinstance(part, kinds) for part in self.parts)

    @property
    def is_random(self) -> bool:
        return any(isinstance(part, ObservationNoise) and any(part.std) for part in self.parts)

    @property
    def action_key(self) -> str:
        scales = [part for part in self.parts if isinstance(part, ActionScale)]
        return scales[0].out_keys_inv[0] if scales else "joint_delta"

    @property
    def delta(self) -> float:
        return 1.5 if self.has(ActionScale) else 0.004


def stacked_like_the_paper(fake_grasp: type[EnvBase], sensors: SensorConfig) -> Compose:
    with mock.patch.object(build, "GraspEnv", return_value=fake_grasp()):
        return build_env(1, sensors=sensors, seed=3).transform.clone()


@pytest.fixture(params=[*ALONE, *TOGETHER])
def case(request: pytest.FixtureRequest, fake_grasp: type[EnvBase]) -> Case:
    name = request.param
    return Case(name, ALONE.get(name) or partial(stacked_like_the_paper, fake_grasp, TOGETHER[name]))


def test_every_transform_is_here() -> None:
    classes = {name for name in ours.__all__ if isinstance(getattr(ours, name), type)}
    assert classes == {type(make()).__name__ for make in ALONE.values()}


def assert_same(one: TensorDictBase, other: TensorDictBase, keys: Iterable | None = None) -> None:
    if keys is None:
        keys = set(one.keys(True, True))
        assert keys == set(other.keys(True, True))
    for key in keys:
        torch.testing.assert_close(
            one.get(key), other.get(key), rtol=0, atol=0, msg=lambda text, key=key: f"{key}: {text}"
        )


parallel_env = partial(ParallelEnv, mp_start_method="fork")


def check_batched(env: EnvBase, make_env: Callable[[], EnvBase], play: Callable, given: Tensor | None) -> None:
    """Specs hold, and each worker does what an env of its own does with the same seed and ``given`` actions."""
    try:
        if given is not None:
            env.set_seed(7)
            together, seed = play(env, given), 7
            for worker in range(WORKERS):
                single = make_env()
                seed = single.set_seed(seed)
                assert_same(together[worker], play(single, given[:, worker]))
        check_env_specs(env)
    finally:
        env.close()


# --- torchrl's obligations, by torchrl's names


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=["float32", "float64"])
@pytest.mark.parametrize("batch", [(), (3,), (2, 2)], ids=str)
def test_single_trans_env_check(case: Case, fake_grasp: type[EnvBase], batch: tuple, dtype: torch.dtype) -> None:
    check_env_specs(TransformedEnv(fake_grasp(batch, dtype=dtype), case.make()))


@pytest.fixture
def check_trans_in_workers(case: Case, fake_grasp, play, actions) -> Callable:
    def check(kind: Callable) -> None:
        def make_env() -> TransformedEnv:
            return TransformedEnv(fake_grasp(), case.make())

        check_batched(kind(WORKERS, make_env), make_env, play, actions(STEPS, WORKERS, 3, size=case.delta))

    return check


def test_serial_trans_env_check(check_trans_in_workers: Callable) -> None:
    check_trans_in_workers(SerialEnv)


@pytest.mark.parametrize("case", TOGETHER, indirect=True)  # all of them at once: to start processes takes long
def test_parallel_trans_env_check(check_trans_in_workers: Callable) -> None:
    check_trans_in_workers(parallel_env)


@pytest.fixture
def check_trans_around_workers(case: Case, fake_grasp, play, actions) -> Callable:
    # no batch within the workers: torchrl's CatFrames cannot reset parts of a batch with two dimensions
    make_base = partial(fake_grasp, ())

    def check(kind: Callable) -> None:
        # noise of shape (2, 2) is not noise of shape (2,) twice
        given = None if case.is_random else actions(STEPS, WORKERS, size=case.delta)
        env = TransformedEnv(kind(WORKERS, make_base), case.make())
        check_batched(env, lambda: TransformedEnv(make_base(), case.make()), play, given)

    return check


def test_trans_serial_env_check(check_trans_around_workers: Callable) -> None:
    check_trans_around_workers(SerialEnv)


@pytest.mark.parametrize("case", TOGETHER, indirect=True)
def test_trans_parallel_env_check(check_trans_around_workers: Callable) -> None:
    check_trans_around_workers(parallel_env)


@dataclass(frozen=True)
class Recording:
    """A transformed rollout, batch ``(3, STEPS)``, and what its base env did meanwhile."""

    rollout: TensorDict
    base: TensorDict

    @property
    def added(self) -> set:
        keys = set(self.rollout.get("next").keys(True, True))
        return {key for key in keys if key not in self.base.get("next").keys(True, True)}


@pytest.fixture
def recording(case: Case, fake_grasp, play, actions) -> Recording:
    rollout = play(TransformedEnv(fake_grasp(), case.make()), actions(STEPS, 3, size=case.delta))
    base = fake_grasp()
    return Recording(rollout, play(base, rollout.get(("next", "received")).transpose(0, 1)))


def without_env(transform: Transform, recording: Recording, steps: int) -> list[TensorDictBase]:
    """Drives a transform by hand over the base env's frames. Returns the frames of reset and each step."""
    base, given = recording.base, recording.rollout
    for part in transform.modules():
        if isinstance(part, CatFrames):
            part.reset_key = "_reset"  # or it would ask its env
    frame = base[:, 0].exclude("next", "joint_delta")
    frames = [transform._reset(frame.empty(), frame)]
    for step in range(steps):
        before = frames[-1].clone().update(given[:, step].select("action", "joint_delta", strict=False))
        frames.append(transform._step(before, base[:, step].get("next").clone()))
    return frames


def test_transform_no_env(case: Case, recording: Recording) -> None:
    frames = without_env(case.make(), recording, 3)
    expected = [recording.rollout[:, 0], *(recording.rollout[:, step].get("next") for step in range(3))]
    for frame, want in zip(frames, expected, strict=True):
        assert_same(frame, want, frame.keys(True, True))
        assert recording.added <= set(frame.keys(True, True))


def test_transform_compose(case: Case, recording: Recording) -> None:
    alone, composed = (without_env(make(), recording, 3) for make in (case.make, lambda: Compose(case.make())))
    for one, other in zip(alone, composed, strict=True):
        assert_same(one, other)
    frame = recording.rollout[:, 0].exclude("next")
    assert_same(case.make().inv(frame), Compose(case.make()).inv(frame))


def test_transform_env(case: Case, recording: Recording) -> None:
    rollout, base = recording.rollout, recording.base
    written = {key for part in case.parts for key in (*part.out_keys, *part.in_keys_inv)}
    untouched = set(base.get("next").keys()) - written
    assert_same(rollout, base, untouched)
    assert_same(rollout.get("next"), base.get("next"), untouched)
    ends = rollout.get(("next", "done"))
    assert ends.any()
    assert not ends.all(0).any(), "rows are meant to end one by one"
    for part in case.parts:
        for key in part.out_keys:
            assert key in rollout.get("next").keys(True, True)
    assert all(value.isfinite().all() for value in rollout.values(True, True))


def test_transform_real_env() -> None:
    env = build_env(2, physics=PhysicsConfig("fast", threads=1), grasp=GraspConfig(steps=3))
    check_env_specs(env, break_when_any_done="both")


def test_transform_model(case: Case, recording: Recording) -> None:
    transform, frame = case.make(), recording.base[:, 2].get("next").clone()
    if case.has(MEMORY):
        with pytest.raises(RuntimeError, match=REFUSAL):
            nn.Sequential(transform, nn.Identity())(frame)
        return
    key = transform.out_keys[0] if transform.out_keys else "force"
    read = TensorDictModule(nn.Identity(), in_keys=[key], out_keys=["read"])
    want = case.make()._call(frame.clone())
    out = nn.Sequential(transform, read)(frame.clone())
    assert_same(out.exclude("read"), want)
    torch.testing.assert_close(out.get("read"), want.get(key), rtol=0, atol=0)


def test_transform_rb(case: Case, recording: Recording) -> None:
    # those with memory get frames that have it, so that nothing but their own refusal stops them
    source = recording.rollout if case.has(MEMORY) else recording.base
    frames = source.reshape(-1).exclude("next")
    frames.set("action", recording.rollout.get(case.action_key).reshape(-1, 2))
    buffer = ReplayBuffer(storage=LazyTensorStorage(len(frames)), transform=case.make(), batch_size=len(frames))
    if case.has(MEMORY):
        buffer.extend(frames)
        with pytest.raises(RuntimeError, match=REFUSAL):
            buffer.sample()
        return
    buffer.extend(frames)
    # a buffer stores what the inverse made of the frames, and applies the rest when it is sampled
    assert_same(buffer[:], case.make()(case.make().inv(frames)))
    assert set(buffer.sample().keys()) >= {*frames.keys(), *case.make().out_keys, *case.make().in_keys_inv}


def test_transform_inverse(case: Case, recording: Recording) -> None:
    frame = recording.rollout[:, 2].exclude("next")
    kept = frame.clone()
    out = case.make().inv(frame)
    assert_same(frame, kept)
    torch.testing.assert_close(
        out.get("joint_delta"), recording.rollout[:, 2].get(("next", "received")), rtol=0, atol=0
    )
    assert_same(out.exclude("joint_delta"), kept.exclude("joint_delta"))
    if case.has(INVERSE):
        assert not torch.equal(out.get("joint_delta"), kept.get("joint_delta", kept.get("action", None)))


# --- ours


@pytest.mark.parametrize("name", ALONE)
def test_specs_follow_the_env_not_the_default_device(name: str, fake_grasp: type[EnvBase]) -> None:
    env = TransformedEnv(fake_grasp(), ALONE[name]())
    with torch.device("meta"):
        specs = env.output_spec, env.input_spec
    assert {spec.device.type for each in specs for spec in each.values(True, True)} == {"cpu"}


def test_partial_reset(case: Case, fake_grasp, actions) -> None:
    def steps(env: EnvBase, state: TensorDictBase, given: Tensor) -> TensorDictBase:
        for action in given:
            state = step_mdp(env.step(state.set(env.action_key, action.clone())))
        return state

    given = actions(3, 4, size=case.delta)
    mask = torch.tensor([True, False, True, False])
    env, undisturbed = (TransformedEnv(fake_grasp((4,), steps=50), case.make()) for _ in range(2))
    before = steps(env, env.reset(), given[:2])
    state = env.reset(before.clone().set("_reset", mask.unsqueeze(-1))).exclude("_reset", env.action_key)
    keys = env.observation_spec.keys(True, True)
    assert_same(before[~mask], state[~mask], keys)
    assert not torch.equal(before[mask].get("joint_position"), state[mask].get("joint_position"))
    for part in case.parts:
        if isinstance(part, MEMORY):
            memory = part.term_key if isinstance(part, ActionChangePenalty) else part.out_keys[0]
            assert before[mask].get(memory).any(), "nothing to forget"
            assert not state[mask].get(memory).any()

    after = steps(env, state, given[2:])
    if not case.is_random:
        want = steps(undisturbed, undisturbed.reset(), given)
        assert_same(after[~mask], want[~mask], keys)


def test_state_dict_round_trip(case: Case, recording: Recording) -> None:
    transform, other = case.make(), case.make()
    without_env(transform, recording, 2)
    state = {key: value.clone() for key, value in transform.state_dict().items()}
    runs = [without_env(transform, recording, 2)]
    without_env(other, recording, 0)  # CatFrames has no buffer to load into before its first frame
    other.load_state_dict(state)
    runs.append(without_env(other, recording, 2))
    for one, two in zip(*runs, strict=True):
        assert_same(one, two)
    fresh = without_env(case.make(), recording, 2)
    pairs = zip(fresh, runs[0], strict=True)
    repeats = all(torch.equal(a.get(key), b.get(key)) for a, b in pairs for key in a.keys(True, True))
    assert repeats is not case.is_random


def test_same_seed_same_stream(case: Case, fake_grasp, play, actions) -> None:
    given = actions(STEPS, 3, size=case.delta)
    one, two = (play(TransformedEnv(fake_grasp(), case.make()), given) for _ in range(2))
    assert_same(one, two)


@pytest.mark.parametrize("name", TOGETHER)
def test_build_env_seeds_grasps_and_noise_apart(name: str, fake_grasp, play, actions) -> None:
    def run(seed: int) -> TensorDict:
        with mock.patch.object(build, "GraspEnv", return_value=fake_grasp()):
            return play(build_env(3, sensors=TOGETHER[name], seed=seed), given)

    given = actions(STEPS, 3)
    one, two, three = run(0), run(0), run(1)
    assert_same(one, two)
    assert not torch.equal(one.get("joint_position"), three.get("joint_position"))
    noise = [rollout.get("sensed_force") - rollout.get("force") for rollout in (one, three)]
    assert torch.allclose(*noise, rtol=0, atol=1e-6) is (name == "paper without noise")
