"""On the robot as in training: the same readings lead to the same actions and commands."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from torchrl.envs.utils import ExplorationType, set_exploration_type

from forcegrasp.config import (
    ActionConfig,
    ExportConfig,
    GraspConfig,
    ObservationConfig,
    PhysicsConfig,
    PPOConfig,
    SensorConfig,
    TrainConfig,
)
from forcegrasp.controllers import ForcePI
from forcegrasp.deploy import Contract, GraspController
from forcegrasp.env import build_env
from forcegrasp.runs.export import contract_of, export_policy
from forcegrasp.runs.policy import load_policy

ROWS, STEPS = 20, 50
TOLERANCE = 1e-5

VARIANTS = {
    "paper": {},
    "no bias, one frame": {"action": ActionConfig(inductive_bias=False), "observation": ObservationConfig(frames=1)},
    "other bias, four frames, parts turned round": {
        "action": ActionConfig(0.005, bias_one_contact=0.5, bias_floor=0.2),
        "observation": ObservationConfig(["had_contact", "last_action", "force_error", "force", "position"], 4),
    },
    "other sensors, two frames, parts left out": {
        "sensors": SensorConfig(0.0, 0.002, contact_threshold_n=0.02),
        "observation": ObservationConfig(["force_error", "had_contact"], 2),
    },
    "not mirrored": {"ppo": PPOConfig(hidden=[8, 8], mirrored=False)},
}


def roll_out(config: TrainConfig, policy, primer=None):
    env = build_env(
        ROWS,
        physics=config.physics,
        grasp=config.grasp,
        sensors=config.sensors,
        observation=config.observation,
        action=config.action,
        seed=5,
    )
    if primer is not None:
        env.append_transform(primer)
    with torch.no_grad(), set_exploration_type(ExplorationType.DETERMINISTIC):
        return env.rollout(STEPS, policy, break_when_any_done=False)


def differences(controller: GraspController, config: TrainConfig, rollout) -> tuple[float, float]:
    """Largest |action − environment's| and |command − environment's| (metres), over all grasps and steps."""
    names = ("sensed_position", "measured_position", "sensed_force", "action", "goal_force")
    data = {name: rollout[name].double().numpy() for name in names}
    commanded = rollout["next", "commanded_position"].double().numpy()
    actions, commands = [], []
    for row in range(ROWS):
        controller.reset(data["goal_force"][row, 0, 0])
        for step in range(STEPS):
            q = data["sensed_position"][row, step]
            q_des = controller.step(q, data["sensed_force"][row, step], step * 0.04)
            assert controller.fault is None  # the limits leave training as it is
            if config.sensors.position_std_m:
                # the environment adds Δq to the position before noise; a robot has but one reading
                q_des = np.clip(data["measured_position"][row, step] + controller.delta_m, 0.0, 0.045)
            actions.append(np.abs(controller.action - np.clip(data["action"][row, step], -1, 1)).max())
            commands.append(np.abs(q_des - commanded[row, step]).max())
    return max(actions), max(commands)


@pytest.mark.parametrize("name", VARIANTS)
def test_exported_policy(name, make_run, tmp_path):
    run, config = make_run(**VARIANTS[name])
    policy, _ = load_policy(run)
    export_policy(run, tmp_path / "out", ceiling_n=2.0)
    rollout = roll_out(config, policy)
    touching = rollout["had_contact"].sum(-1)
    for fingers in (0, 1, 2):  # the states are of every phase
        assert (touching == fingers).float().mean() > 0.01
    assert rollout["action"].abs().max() > 1
    action, command = differences(GraspController.load(tmp_path / "out"), config, rollout)
    assert action <= TOLERANCE
    assert command <= TOLERANCE * 0.01


def test_force_pi():
    grasp = GraspConfig(radius_m=[0.03, 0.035], offset_m=[-0.006, 0.006])
    config = TrainConfig(grasp=grasp, physics=PhysicsConfig("fast", 1), action=ActionConfig(inductive_bias=False))
    policy = ForcePI()
    rollout = roll_out(config, policy, policy.make_tensordict_primer())
    assert (rollout["had_contact"].sum(-1) == 2).float().mean() > 0.5
    action, command = differences(GraspController.baseline(), config, rollout)
    assert action <= TOLERANCE
    assert command <= TOLERANCE * 0.01


def test_contact_at_the_first_reading_counts_from_the_second(exported):
    """h(0) = 0 whatever the force, as in training."""
    controller = GraspController.load(exported)
    controller.reset(0.5)
    for expected in (0.0, 1.0):
        controller.step([0.03, 0.03], [0.3, 0.3])
        assert (controller.policy._stack[-2:] == expected).all()


def test_defaults_of_the_contract_are_those_of_training():
    trained = dataclasses.asdict(contract_of(TrainConfig(), ExportConfig().ceiling_n))
    for name, value in dataclasses.asdict(Contract()).items():
        assert trained[name] == (value if name == "parts" else pytest.approx(value)), name
