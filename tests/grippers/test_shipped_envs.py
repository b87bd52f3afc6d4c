"""The environment, its controllers and its readings on every shipped gripper."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torchrl.envs import TransformedEnv
from torchrl.envs.utils import check_env_specs

from forcegrasp.config import GraspConfig, ObservationConfig, PhysicsConfig
from forcegrasp.controllers import ForcePI, make_controller
from forcegrasp.controllers.policy import part_sizes
from forcegrasp.effects.for_gripper import effect_of
from forcegrasp.env import build_env
from forcegrasp.models.model_file import Fitted, FoundEffect, Model
from forcegrasp.physics import Gripper
from forcegrasp.physics.sensors import with_noise
from forcegrasp.transforms import ObservationNoise

FAST = PhysicsConfig(tier="fast", threads=1)


def build(gripper: Gripper, n: int = 3, steps: int = 60, **parts) -> TransformedEnv:
    return build_env(n, gripper=gripper, physics=FAST, grasp=GraspConfig(steps=steps), **parts)


def rounding_model(gripper: Gripper) -> Model:
    """A model whose readings are rounded, coarsely enough to be seen."""
    effect = effect_of("quantisation", gripper)
    sizes = 10 * effect.typical_values()
    parameters = {p.name: Fitted(*[float(size)] * 3) for p, size in zip(effect.parameters, sizes, strict=True)}
    return Model(gripper, {}, effects=(FoundEffect(effect, "", parameters),))


def test_specs_and_sizes(gripper):
    env, observation = build(gripper, steps=4), ObservationConfig(["force", "position", "had_contact"], 2)
    check_env_specs(env, seed=0)
    for one, parts in ((env, ObservationConfig()), (build(gripper, observation=observation), observation)):
        assert one.observation_spec["observation"].shape == (3, sum(part_sizes(gripper, parts)))
    motors, channels = len(gripper.motors), len(gripper.forces)
    assert sum(part_sizes(gripper, observation)) == 2 * (motors + 2 * channels)
    assert env.full_action_spec["action"].shape == (3, motors)


@pytest.mark.parametrize("name", ["force_pi", "informed"])
def test_controllers_reach_the_object_and_stay_finite(gripper, name):
    controller, env = make_controller(name, gripper).eval(), build(gripper, steps=120)
    if isinstance(controller, ForcePI):
        env.append_transform(controller.make_tensordict_primer())
    rollout = env.rollout(120, controller, break_when_any_done=False)
    assert all(value.isfinite().all() for value in rollout.values(True, True) if value.dtype == torch.float32)
    after = rollout.get("next")
    assert after["had_contact"][:, -1].all()
    late = after["force"][:, -25:].mean((1, 2))
    assert ((late > 0.3 * after["goal_force"][:, -1, 0]) & (late < 3 * after["goal_force"][:, -1, 0])).all()


def test_readings_are_rounded_after_the_noise(gripper):
    model = rounding_model(gripper)
    steps = model.effects[0].values
    after = build(gripper, model=model).rollout(40, break_when_any_done=False).get("next")
    for reading, truth, step in zip(("position", "force"), ("joint_position", None), steps, strict=True):
        sensed, measured = after[f"sensed_{reading}"].double(), after[f"measured_{reading}"].double()
        np.testing.assert_allclose(sensed / step, (sensed / step).round(), atol=1e-4)
        assert (measured / step - (measured / step).round()).abs().max() > 1e-3 or not measured.any()
        if truth:
            assert torch.equal(measured, after[truth].double())


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_recording_and_environment_read_the_same(gripper, dtype):
    """From one state and the same normal numbers, to the last bit: record, with numpy, and what policies see."""
    env = build(gripper, model=rounding_model(gripper))
    state = env.rollout(30, break_when_any_done=False).get("next").to(dtype)
    noise = next(t for t in env.transform if isinstance(t, ObservationNoise))
    before = noise.generator.clone_state()
    seen = noise(state.clone())
    for name, std, step in zip(("position", "force"), noise.std, noise.step, strict=True):
        truth = state[f"measured_{name}"]
        normal = torch.randn(truth.shape, generator=before, dtype=dtype).numpy()
        recorded = with_noise(truth.numpy(), std, normal, step)
        assert step > 0
        np.testing.assert_array_equal(seen[f"sensed_{name}"].numpy(), recorded)
