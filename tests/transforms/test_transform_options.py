"""Every option of every transform changes something, and none is left out of this list."""

from __future__ import annotations

import inspect
from typing import Any

import pytest
import torch
from tensordict import TensorDict
from torchrl.data import Bounded, Composite, Unbounded
from torchrl.envs.transforms import Transform

from forcegrasp import transforms
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

BASE = {
    ObservationNoise: {"in_keys": ["force"], "out_keys": ["sensed_force"], "std": [0.1], "seed": 0},
    HadContact: {"threshold": 0.3},
    ForceError: {},
    LastAction: {},
    TouchForce: {},
    ActionChangePenalty: {"weight": 0.5},
    InductiveBias: {"floor": 0.1},
    ActionScale: {"max_delta": 0.003},
}
CHANGED = [
    (ObservationNoise, "in_keys", ["spare"]),
    (ObservationNoise, "out_keys", ["reading"]),
    (ObservationNoise, "std", [0.2]),
    (ObservationNoise, "seed", 1),
    (ObservationNoise, "step", [0.25]),
    (ObservationNoise, "per_row", "spare"),
    (HadContact, "threshold", 0.7),
    (HadContact, "stall", 0.2),
    (HadContact, "in_key", "spare"),
    (HadContact, "out_key", "spare"),
    (HadContact, "position_key", "spare"),
    (ForceError, "goal_key", "spare"),
    (ForceError, "force_key", "spare"),
    (ForceError, "out_key", "error"),
    (LastAction, "action_key", "spare"),
    (LastAction, "out_key", "before"),
    (LastAction, "like", "goal_force"),
    (TouchForce, "force_key", "spare"),
    (TouchForce, "had_contact_key", "spare"),
    (TouchForce, "out_key", "spare_goal"),
    (ActionChangePenalty, "weight", 1.0),
    (ActionChangePenalty, "last_action_key", "spare"),
    (ActionChangePenalty, "reward_key", "bonus"),
    (ActionChangePenalty, "out_key", "penalty"),
    (InductiveBias, "one", 0.2),
    (InductiveBias, "floor", 0.5),
    (InductiveBias, "gentle_n", 5.0),
    (InductiveBias, "delta_key", "spare"),
    (InductiveBias, "had_contact_key", "spare"),
    (InductiveBias, "force_error_key", "spare"),
    (InductiveBias, "goal_key", "spare_goal"),
    (InductiveBias, "touch_key", "spare_goal"),
    (ActionScale, "max_delta", 0.004),
    (ActionScale, "delta_key", "spare_delta"),
    (ActionScale, "action_key", "spare"),
]
#: What else has to be given for an option to matter.
NEEDED = {(HadContact, "position_key"): {"stall": 0.2}, (InductiveBias, "touch_key"): {"gentle_n": 5.0}}
SIZES = {
    **dict.fromkeys(["joint_position", "sensed_position", "force", "sensed_force", "force_error"], 2),
    **dict.fromkeys(["last_action", "had_contact", "spare"], 2),
    **dict.fromkeys(["goal_force", "spare_goal", "touch_force"], 1),
}


def make_frames() -> list[TensorDict]:
    """Two consecutive frames with every key that the table above mentions; all numbers differ."""
    generator = torch.Generator().manual_seed(0)
    sizes = SIZES | {"action": 2, "joint_delta": 2, "reward": 1, "bonus": 1}
    frames = []
    for _ in range(2):
        values = {key: torch.rand(16, size, generator=generator) + 0.01 for key, size in sizes.items()}
        values["had_contact"] = values["had_contact"].round()
        frames.append(TensorDict(values, batch_size=[16]))
    return frames


def everything(transform: Transform) -> dict[str, Any]:
    """All that a transform writes and declares."""
    before, after = make_frames()
    observation = Composite({key: Unbounded(shape=(16, size)) for key, size in SIZES.items()}, shape=(16,))
    deltas = Composite({key: Bounded(-9, 9, shape=(16, 2)) for key in ("joint_delta", "spare_delta")}, shape=(16,))
    inputs = Composite(full_action_spec=deltas, full_state_spec=Composite(shape=(16,)), shape=(16,))
    return {
        "reset": transform._reset(before.clone(), before.clone()),
        "step": transform._step(before.clone(), after.clone()),
        "inverse": transform.inv(before.clone()),
        "observation spec": transform.transform_observation_spec(observation),
        "input spec": transform.transform_input_spec(inputs),
    }


def is_equal(one: Any, other: Any) -> bool:
    if isinstance(one, Composite):
        return one == other
    keys = set(one.keys(True, True))
    return keys == set(other.keys(True, True)) and all(torch.equal(one.get(key), other.get(key)) for key in keys)


def test_every_option_is_in_the_table() -> None:
    classes = [value for name in transforms.__all__ if isinstance(value := getattr(transforms, name), type)]
    options = {(kind, option) for kind in classes for option in inspect.signature(kind).parameters}
    assert options == {(kind, option) for kind, option, _ in CHANGED} | {(ObservationNoise, "device")}


def test_noise_is_drawn_on_its_device(monkeypatch) -> None:
    asked, plain = [], torch.Generator
    monkeypatch.setattr(torch, "Generator", lambda device: asked.append(device) or plain())
    ObservationNoise(**BASE[ObservationNoise], device="cuda")
    assert asked == ["cuda"]


@pytest.mark.parametrize(("kind", "option", "value"), CHANGED, ids=lambda item: getattr(item, "__name__", str(item)))
def test_option_changes_something(kind: type, option: str, value: Any) -> None:
    base = BASE[kind] | NEEDED.get((kind, option), {})
    default, same = (everything(kind(**base)) for _ in range(2))
    changed = everything(kind(**base | {option: value}))
    assert all(is_equal(default[part], same[part]) for part in default)
    assert not all(is_equal(default[part], changed[part]) for part in default)
