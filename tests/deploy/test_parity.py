"""On the robot as in training: the same readings lead to the same actions and commands."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torchrl.envs.utils import ExplorationType, set_exploration_type

from forcegrasp.config import (
    ActionConfig,
    GraspConfig,
    ObservationConfig,
    PhysicsConfig,
    PPOConfig,
    SACConfig,
    SensorConfig,
    TrainConfig,
)
from forcegrasp.controllers import ForcePI
from forcegrasp.deploy import GraspController
from forcegrasp.env import build_env, with_memory
from forcegrasp.physics import load_gripper, shipped_grippers
from forcegrasp.runs.export import export_policy
from forcegrasp.runs.policy import load_policy

ROWS, STEPS = 10, 60
TOLERANCE = 1e-5

VARIANTS = {
    "paper": {},
    "no bias, one frame": {"action": ActionConfig(inductive_bias=False), "observation": ObservationConfig(frames=1)},
    "other bias, four frames, parts turned round": {
        "action": ActionConfig(0.005, bias_one_contact=0.5, bias_floor=0.2),
        "observation": ObservationConfig(["had_contact", "last_action", "force_error", "force", "position"], 4),
    },
    "a gentle last finger": {"action": ActionConfig(bias_one_contact=0.0, gentle_touch=1.0)},
    "other sensors, two frames, parts left out": {
        "sensors": SensorConfig(0.0, 0.002, contact_threshold_n=0.02),
        "observation": ObservationConfig(["force_error", "had_contact"], 2),
    },
    "not mirrored": {"ppo": PPOConfig(hidden=[8, 8], mirrored=False)},
    "fingers that squeeze together": {"ppo": PPOConfig(hidden=[8, 8], squeeze_together=True)},
    "memory": {
        "ppo": PPOConfig(hidden=[8], memory=6, squeeze_together=True),
        "observation": ObservationConfig(frames=1),
    },
    "memory, not mirrored": {"ppo": PPOConfig(hidden=[8], memory=5, mirrored=False)},
    "memory of one motor": {"ppo": PPOConfig(hidden=[8], memory=5), "gripper": "franka_hand", "grasp": GraspConfig()},
    "SAC": {"learner": "sac", "sac": SACConfig(hidden=[16])},
} | {name: {"gripper": name, "grasp": GraspConfig()} for name in [*shipped_grippers(), "one_sensor"]}


def roll_out(config: TrainConfig, policy):
    env = build_env(
        ROWS,
        gripper=config.gripper,
        physics=config.physics,
        grasp=config.grasp,
        sensors=config.sensors,
        observation=config.observation,
        action=config.action,
        seed=5,
    )
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        return with_memory(env, policy).rollout(STEPS, policy, break_when_any_done=False)


def differences(controller: GraspController, config: TrainConfig, rollout) -> tuple[float, float]:
    """Largest |action − environment's| and |command − environment's| (m or rad), over all grasps and steps."""
    names = ("sensed_position", "measured_position", "sensed_force", "action", "goal_force")
    data = {name: rollout[name].double().numpy() for name in names}
    gripper = load_gripper(config.gripper)
    commanded = rollout["next", "commanded_position"].double().numpy()
    actions, commands = [], []
    for row in range(ROWS):
        controller.reset(data["goal_force"][row, 0, 0])
        for step in range(STEPS):
            q = data["sensed_position"][row, step]
            q_des = controller.step(q, data["sensed_force"][row, step], step * 0.04)
            assert controller.fault is None  # the limits leave training as it is
            if config.sensors.position_std_m != 0:
                # the environment adds Δq to the position before noise; a robot has but one reading
                q_des = np.clip(data["measured_position"][row, step] + controller.delta_m, 0.0, gripper.stroke)
            actions.append(np.abs(controller.action - np.clip(data["action"][row, step], -1, 1)).max())
            commands.append(np.abs(q_des - commanded[row, step]).max())
    return max(actions), max(commands)


@pytest.mark.parametrize("name", VARIANTS)
def test_exported_policy(name, make_run, tmp_path, one_sensor):
    variant = VARIANTS[name] | ({"gripper": str(one_sensor)} if name == "one_sensor" else {})
    run, config = make_run(**variant)
    policy, _ = load_policy(run)
    export_policy(run, tmp_path / "out")
    rollout = roll_out(config, policy)
    touching = rollout["had_contact"].sum(-1)
    for count in range(rollout["had_contact"].shape[-1] + 1):  # the states are of every phase
        assert (touching == count).float().mean() > 0.01
    assert rollout["action"].abs().max() > (0.9 if config.learner == "sac" else 1)
    action, command = differences(GraspController.load(tmp_path / "out"), config, rollout)
    assert action <= TOLERANCE
    assert command <= TOLERANCE * 0.01


@pytest.mark.parametrize("name", [*shipped_grippers(), "one_sensor"])
def test_force_pi(name, one_sensor, tmp_path):
    if name == "one_sensor":
        name = str(one_sensor)
        export_policy("force_pi", tmp_path / "out", gripper=name)
    gripper = load_gripper(name)
    large = gripper.training.radius_m[1]  # within reach early
    grasp, action = GraspConfig(radius_m=[0.85 * large, large]), ActionConfig(inductive_bias=False)
    config = TrainConfig(gripper=name, grasp=grasp, physics=PhysicsConfig("fast", 1), action=action)
    policy = ForcePI(gripper)
    rollout = roll_out(config, policy)
    assert rollout["had_contact"].all(-1).float().mean() > 0.5
    folder = tmp_path / "out" if "/" in name else name
    action, command = differences(GraspController.baseline(gripper=folder), config, rollout)
    assert action <= TOLERANCE
    assert command <= TOLERANCE * 0.01


def test_contact_at_the_first_reading_counts_from_the_second(exported):
    """h(0) = 0 whatever the force, as in training."""
    controller = GraspController.load(exported)
    controller.reset(0.5)
    for expected in (0.0, 1.0):
        controller.step([0.03, 0.03], [0.3, 0.3])
        assert (controller.policy._stack[-2:] == expected).all()
