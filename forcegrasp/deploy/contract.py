"""What a policy and its controller agree on, and the file that says it: ``contract.json`` beside ``policy.onnx``.

JSON, because Python reads it without a package, other languages read it too, and its numbers come back to the last bit.
"""

# pyright: standard

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from forcegrasp.bounded import read_bytes
from forcegrasp.errors import DeployError, closest

FORMAT = "forcegrasp-policy/1"
CONTRACT_FILE, NETWORK_FILE = "contract.json", "policy.onnx"
#: Name, number type and meaning of what goes in and comes out of the network.
INPUT, OUTPUT = "observation", "action"
FINGERS = 2
_MAX_CONTRACT_BYTES, _MAX_NETWORK_BYTES = 1_000_000, 500_000_000
#: Type of an entry → types of its value or of its list's items, as JSON gives them, and how to say that.
_KINDS: dict[str, tuple[set[type], str]] = {
    "bool": ({bool}, "true or false"),
    "int": ({int}, "a whole number"),
    "float": ({int, float}, "a number"),
    "tuple[float, float]": ({int, float}, "[low, high]"),
    "tuple[str, ...]": ({str}, "a list of names"),
}
#: Part of the observation → unit; (left, right) each.
PARTS = {"position": "1, scaled", "force": "N", "force_error": "N", "last_action": "1", "had_contact": "0 or 1"}


@dataclass(frozen=True)
class Contract:
    """How readings become an observation and an action a command, and what must hold whatever the policy says.

    The defaults are those of the paper's gripper and learning problem. The training side has them in
    ``forcegrasp.config`` and ``forcegrasp.physics``, which a robot need not have; a test holds both together.

    Raises:
      ValueError: if the values can't be right, in one line.
    """

    parts: tuple[str, ...] = tuple(PARTS)  #: parts of o(t), in this order
    frames: int = 3  #: o(t) stacked, the oldest first; at the start the first one repeated
    position_scale_per_m: float = 2 / 0.045  #: position part = scale · q + offset
    position_offset: float = -1.0
    contact_threshold_n: float = 0.05  #: f_θ; a finger has had contact once its force exceeded this
    inductive_bias: bool = True  #: whether Δq is scaled by φ (paper, eq. 7)
    bias_one_contact: float = 0.1  #: φ of a finger that waits for the other
    bias_floor: float = 0.9  #: smallest φ with both fingers in contact
    max_delta_m: float = 0.003  #: Δq_max
    joint_range_m: tuple[float, float] = (0.0, 0.045)  #: closed, open
    goal_range_n: tuple[float, float] = (0.08, 1.425)  #: goal forces that were trained
    control_period_s: float = 0.04  #: time from one step to the next
    ceiling_n: float = 2.0  #: above this force at either finger, none closes further
    position_reading_m: tuple[float, float] = (-0.002, 0.047)  #: readings beyond this can't be true
    force_reading_n: tuple[float, float] = (-1.0, 20.0)  #: readings beyond this can't be true
    gap_s: tuple[float, float] = (0.02, 0.1)  #: shortest and longest time from one reading to the next

    def __post_init__(self) -> None:
        unknown = [part for part in self.parts if part not in PARTS]
        if unknown:
            raise ValueError(f"no observation part {unknown[0]!r}{closest(unknown[0], PARTS)}")
        if not self.parts or len(set(self.parts)) < len(self.parts):
            raise ValueError("parts must name each part of the observation once, and at least one")
        if self.frames < 1:
            raise ValueError(f"frames={self.frames}: must be at least 1")
        for name, value in vars(self).items():
            numbers = value if isinstance(value, tuple) else (value,)
            if not all(isinstance(n, str) or math.isfinite(n) for n in numbers):
                raise ValueError(f"{name}={value}: must be finite")
            if isinstance(value, tuple) and name != "parts" and value[0] > value[1]:
                raise ValueError(f"{name}={list(value)}: must be [low, high] with low ≤ high")
        for name in ("bias_one_contact", "bias_floor"):
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"{name}={getattr(self, name)}: must lie in [0, 1]")
        for name in ("position_scale_per_m", "max_delta_m", "control_period_s"):
            if getattr(self, name) <= 0:
                raise ValueError(f"{name}={getattr(self, name)}: must be positive")
        if self.goal_range_n[0] <= 0 or self.contact_threshold_n < 0 or self.gap_s[0] < 0:
            raise ValueError("goal_range_n, contact_threshold_n and gap_s must not reach below 0")
        if not self.goal_range_n[0] <= self.ceiling_n <= self.force_reading_n[1]:
            lowest, highest = self.goal_range_n[0], self.force_reading_n[1]
            raise ValueError(
                f"ceiling_n={self.ceiling_n:g}: must lie between the smallest goal, {lowest:g} N,"
                f" and the largest reading that can be true, {highest:g} N"
            )

    @property
    def observation_size(self) -> int:
        """Length of the stacked observation."""
        return FINGERS * len(self.parts) * self.frames

    def __str__(self) -> str:
        """The control loop in one line."""
        goal = " to ".join(f"{n:g}" for n in self.goal_range_n)
        return (
            f"{1 / self.control_period_s:g} Hz, goal {goal} N, at most {self.max_delta_m * 1000:g} mm a step,"
            f" ceiling {self.ceiling_n:g} N"
        )


def write_contract(folder: Path, contract: Contract, network: bytes, source: dict[str, Any]) -> None:
    """Writes ``contract.json`` for the bytes of ``policy.onnx``; ``source`` says where the policy is from."""
    content = {
        "format": FORMAT,
        "network": {
            "sha256": hashlib.sha256(network).hexdigest(),
            "input": {
                "name": INPUT,
                "dtype": "float32",
                "shape": [1, contract.observation_size],
                "layout": "frames, the oldest first; in a frame the parts; in a part left, right; at the start the"
                " first frame is repeated",
                "parts": {part: PARTS[part] for part in contract.parts},
            },
            "output": {
                "name": OUTPUT,
                "dtype": "float32",
                "shape": [1, FINGERS],
                "layout": "left, right; negative closes; not clipped: clip to [-1, 1]",
            },
        },
        "control": dataclasses.asdict(contract),
        "source": source,
    }
    (folder / CONTRACT_FILE).write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", "utf-8")


def read_contract(folder: Path | str) -> tuple[Contract, bytes]:
    """Reads an exported folder; returns the contract, and the bytes of the network, which are those it was made for.

    Raises:
      DeployError: if a file is missing or damaged, of an unknown format, or the two don't belong together.
    """
    path = Path(folder) / CONTRACT_FILE
    if not path.is_file():
        raise DeployError(f"{folder}: not an exported policy (no {CONTRACT_FILE}); forcegrasp export makes one")
    try:
        content = json.loads(read_bytes(path, _MAX_CONTRACT_BYTES).decode(), parse_constant=_refuse)
    except OSError as error:
        raise DeployError(f"{path}: could not read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise DeployError(f"{path}: not valid JSON ({error})") from error
    try:
        written = _entry(content, "format", str)
        if written != FORMAT:
            raise ValueError(f"format is {written!r}, but this version reads {FORMAT!r}: export the policy with it")
        expected = _entry(_entry(content, "network", dict), "sha256", str)
        contract = _contract(_entry(content, "control", dict))
    except (ValueError, OverflowError) as error:
        raise DeployError(f"{path}: {error}") from error
    network = Path(folder) / NETWORK_FILE
    try:
        data = read_bytes(network, _MAX_NETWORK_BYTES)
    except OSError as error:
        raise DeployError(f"{network}: could not read ({error.strerror}); export the policy again") from error
    if hashlib.sha256(data).hexdigest() != expected:
        raise DeployError(f"{network}: not the network that {CONTRACT_FILE} was written for; export the policy again")
    return contract, data


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no number")


def _entry(owner: Any, name: str, kind: type) -> Any:
    value = owner.get(name) if isinstance(owner, dict) else None
    if not isinstance(value, kind):
        raise ValueError(f"{name} is missing or not a {kind.__name__}")
    return value


def _contract(control: dict[str, Any]) -> Contract:
    """The contract of a ``control`` section, every entry of which must be there and of its type."""
    kinds = {entry.name: str(entry.type) for entry in dataclasses.fields(Contract)}
    for name in control:
        if name not in kinds:
            raise ValueError(f"control: no entry {name!r}{closest(name, kinds)}")
    values = {}
    for name, kind in kinds.items():
        if name not in control:
            raise ValueError(f"control: {name} is missing")
        value = control[name]
        types, said = _KINDS[kind]
        items = value if isinstance(value, list) else [value]
        fits = isinstance(value, list) == kind.startswith("tuple")
        fits &= all(type(item) in types for item in items)  # a bool is an int, but not one to take here
        if not fits or (kind == "tuple[float, float]" and len(items) != 2):
            raise ValueError(f"control: {name}={value!r}: must be {said}")
        values[name] = tuple(value) if isinstance(value, list) else value
    return Contract(**values)
