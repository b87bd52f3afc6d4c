"""The teacher: what it would do, what its student's errors are measured in, and that a student comes near it."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from tensordict import TensorDict

from forcegrasp.physics import default_gripper
from forcegrasp.train.algorithms.teacher import Teacher, imitation_loss
from forcegrasp.train.loop import Trainer

#: κ 0, .5, 1 and what the largest command reaches there, newtons: 0.3 N · f_α.
REACHED = {0.0: 1.5, 0.5: 0.825, 1.0: 0.15}


def batch_of(*grasps: tuple[float, float, float, float, float, float]) -> TensorDict:
    """Frames of (κ, goal, left and right force, left and right contact)."""
    kappa, goal, left, right, one, other = torch.tensor(grasps).T
    parameters = torch.stack([kappa, torch.full_like(kappa, -9.0), *[torch.zeros_like(kappa)] * 2, goal], dim=-1)
    return TensorDict(
        {
            "grasp_parameters": parameters,
            "goal_force": goal.unsqueeze(-1),
            "force": torch.stack([left, right], -1),
            "had_contact": torch.stack([one, other], -1),
        },
        batch_size=len(grasps),
    )


@pytest.mark.parametrize("feedback", [0.0, 0.5, 2.0])
def test_it_holds_the_goal_and_corrects_by_the_true_forces(feedback):
    grasps = [
        (kappa, goal, left, right, 1.0, 1.0)
        for kappa, most in REACHED.items()
        for goal in (0.1, 0.8 * most)
        for left, right in ((0.0, 0.0), (0.1, 0.05), (2.0, 3.0))
    ]
    batch = batch_of(*grasps)
    Teacher(default_gripper(), feedback).label(batch)
    for row, (kappa, goal, left, right, *_) in enumerate(grasps):
        hold = goal / REACHED[kappa]
        taught = -hold * (1 + feedback * kappa * (1 - (left + right) / 2 / goal))
        np.testing.assert_allclose(batch["taught_action"][row], np.clip([taught] * 2, -1, 1), rtol=1e-5)
        np.testing.assert_allclose(batch["taught_unit"][row], [hold] * 2, rtol=1e-5)


def test_before_both_touch_it_closes_and_waits():
    batch = batch_of((0.5, 0.3, 0.0, 0.0, 0.0, 0.0), (0.5, 0.3, 0.1, 0.0, 1.0, 0.0))
    Teacher(default_gripper(), 0.5).label(batch)
    closing = batch["taught_action"][0, 0].item()
    assert closing < -1.1  # lest a student that errs, or that noise explores, closes slower
    assert batch["taught_action"].tolist() == [[closing, closing], [0, closing]]
    assert batch["taught_unit"].tolist() == [[1, 1], [1, 1]]


def test_errors_are_those_of_the_force_as_a_fraction_of_the_goal():
    """A student that is off by 0.1 on a grasp that wants 0.2 is off by a half, twice."""
    frames = TensorDict({"taught_action": torch.tensor([[-0.2, -0.2]]), "taught_unit": torch.full((1, 2), 0.2)}, [1])
    assert float(imitation_loss(torch.tensor([[-0.3, -0.1]]), frames)) == pytest.approx(0.5)
    # one of the two closes harder, and only what it does so beyond a tenth counts more
    assert float(imitation_loss(torch.tensor([[-0.3, -0.1]]), frames, caution=3.0)) == pytest.approx(0.5 + 3 * 0.4**2)
    assert float(imitation_loss(torch.tensor([[-0.21, -0.1]]), frames, caution=3.0)) == pytest.approx(0.05**2 + 0.25)


def test_a_student_comes_near_its_teacher(tiny):
    def distance(trainer: Trainer) -> float:
        Teacher(default_gripper(), 0.5).label(batch)
        with torch.no_grad():
            return float(imitation_loss(trainer.policy(batch.clone())["loc"], batch))

    ppo = {"teacher_weight": 10.0, "teacher_weight_end": 1.0, "epochs": 20, "learning_rate": 0.003, "hidden": [16]}
    taught, left_alone = (Trainer(tiny(grasp={"steps": 45}, ppo=ppo | more)) for more in ({}, {"teacher_weight": 0.0}))
    with torch.no_grad():
        batch = taught.env.rollout(45, taught.policy)
    before = distance(taught)
    for trainer in (taught, left_alone):
        trainer.algorithm.update(batch.clone())
    assert distance(taught) < 0.3 * before
    assert distance(taught) < 0.5 * distance(left_alone)


@pytest.mark.parametrize("share", [-1.0, 0.0, 0.25, 1.0, 1.5])
def test_its_weight_falls_linearly(tiny, share):
    ppo = Trainer(tiny(ppo={"teacher_weight": 4.0, "teacher_weight_end": 0.5})).algorithm
    ppo.set_progress(share)
    assert ppo.objective.teacher_weight == pytest.approx(np.interp(share, [0, 1], [4.0, 2.0]))
