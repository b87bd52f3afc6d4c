"""The file that says what a policy and its controller agree on: ``contract.json``, beside ``policy.onnx``.

JSON, because Python reads it without a package, other languages read it too, and its numbers come back to the last bit.
"""

# pyright: standard

from __future__ import annotations

import dataclasses
import hashlib
import json
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.deploy.contract import Contract, ForcePIGains, GripperInterface
from forcegrasp.errors import DeployError, closest
from forcegrasp.files.bounded import read_bytes
from forcegrasp.observation import PARTS

FORMAT, FIRST_FORMAT = "forcegrasp-policy/2", "forcegrasp-policy/1"
CONTRACT_FILE, NETWORK_FILE = "contract.json", "policy.onnx"
#: What decides: an exported network, or the hand-written controller.
NETWORK, FORCE_PI = "network", "force_pi"
#: Name of what goes in and comes out of the network; and where it has a memory, of that.
INPUT, OUTPUT = "observation", "action"
MEMORY, NEXT_MEMORY = "memory", "next_memory"
_MAX_CONTRACT_BYTES, _MAX_NETWORK_BYTES = 1_000_000, 500_000_000
#: Type of an entry → types of its value or of its list's items, as JSON gives them, and how to say that.
_KINDS: dict[str, tuple[set[type], str]] = {
    "bool": ({bool}, "true or false"),
    "int": ({int}, "a whole number"),
    "float": ({int, float}, "a number"),
    "float | None": ({int, float, type(None)}, "a number, or null"),
    "str": ({str}, "text"),
    "tuple[float, float]": ({int, float}, "[low, high]"),
    "tuple[str, ...]": ({str}, "a list of names"),
}

Section = TypeVar("Section", Contract, ForcePIGains, GripperInterface)


def write_contract(folder: Path, contract: Contract, decides: bytes | ForcePIGains, source: dict[str, Any]) -> None:
    """Writes ``contract.json``.

    Args:
      folder: where to.
      contract: what to write.
      decides: the bytes of ``policy.onnx``, or the gains of the hand-written controller.
      source: where the policy is from.
    """
    control = dataclasses.asdict(contract)
    content = {"format": FORMAT, "policy": FORCE_PI, "gripper": control.pop("gripper")}
    for later in ("memory", "gentle_n"):
        if not control[later]:
            del control[later]  # versions that know of none read it, too
    if isinstance(decides, ForcePIGains):
        content["gains"] = dataclasses.asdict(decides)
    else:
        content |= {"policy": NETWORK, "network": _network(contract, decides)}
    content |= {"control": control, "source": source}
    (folder / CONTRACT_FILE).write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", "utf-8")


def _network(contract: Contract, network: bytes) -> dict[str, Any]:
    described = {
        "sha256": hashlib.sha256(network).hexdigest(),
        "input": {
            "name": INPUT,
            "dtype": "float32",
            "shape": [1, contract.observation_size],
            "layout": "frames, the oldest first; in a frame the parts; in a part a number for each of its columns; at"
            " the start the first frame is repeated",
            "parts": {part: PARTS[part].unit for part in contract.parts},
            "columns": {part: contract.columns(part) for part in contract.parts},
        },
        "output": {
            "name": OUTPUT,
            "dtype": "float32",
            "shape": [1, contract.action_size],
            "layout": "motors in the order of their positions; negative closes; not clipped: clip to [-1, 1]",
        },
    }
    if contract.memory:
        described["memory"] = {
            "input": MEMORY,
            "output": NEXT_MEMORY,
            "dtype": "float32",
            "shape": [1, contract.memory],
            "layout": "zeros at the first step of a grasp, then what came out at the step before",
        }
    return described


def read_contract(folder: Path | str) -> tuple[Contract, bytes | ForcePIGains]:
    """Reads an exported folder.

    Returns:
      the contract; and what decides: the bytes of the network that it was made for, or the gains of the hand-written
      controller.

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
        written, control = _entry(content, "format", str), _entry(content, "control", dict)
        if written == FIRST_FORMAT:
            first = json.loads((shipped_contracts() / DEFAULT_GRIPPER / CONTRACT_FILE).read_text("utf-8"))
            content |= {"policy": NETWORK, "gripper": first["gripper"]}  # the only one of that format
            control["stall"] = None
        elif written != FORMAT:
            raise ValueError(f"format is {written!r}, but this version reads {FORMAT!r}: export the policy with it")
        gripper = _read(GripperInterface, "gripper", _entry(content, "gripper", dict))
        contract = _read(Contract, "control", control, gripper=gripper)
        policy = _entry(content, "policy", str)
        if policy == FORCE_PI:
            return contract, _read(ForcePIGains, "gains", _entry(content, "gains", dict))
        if policy != NETWORK:
            raise ValueError(f"policy is {policy!r}, but must be {NETWORK} or {FORCE_PI}")
        expected = _entry(_entry(content, "network", dict), "sha256", str)
    except (ValueError, OverflowError) as error:
        raise DeployError(f"{path}: {error}") from error
    return contract, _read_network(Path(folder) / NETWORK_FILE, expected)


def _read_network(path: Path, sha256: str) -> bytes:
    try:
        data = read_bytes(path, _MAX_NETWORK_BYTES)
    except OSError as error:
        raise DeployError(f"{path}: could not read ({error.strerror}); export the policy again") from error
    if hashlib.sha256(data).hexdigest() != sha256:
        raise DeployError(f"{path}: not the network that {CONTRACT_FILE} was written for; export the policy again")
    return data


def shipped_contracts() -> Path:
    """Where the contracts of the hand-written controller are, a folder for each gripper that comes with the package."""
    return Path(str(files("forcegrasp.assets"))) / FORCE_PI


def baseline_folder(gripper: Path | str) -> Path:
    """The folder of a gripper's hand-written controller.

    Args:
      gripper: the name of one that comes with the package, or such a folder.

    Raises:
      DeployError: if there is none.
    """
    known = [path.name for path in shipped_contracts().iterdir()]
    if str(gripper) in known:
        return shipped_contracts() / gripper
    if not (Path(gripper) / CONTRACT_FILE).is_file():
        raise DeployError(
            f"gripper={gripper}: no such gripper{closest(str(gripper), known)}; for one of your own, give the folder"
            f" that `forcegrasp export {FORCE_PI} gripper=DESCRIPTION out=FOLDER` writes"
        )
    return Path(gripper)


def _refuse(constant: str) -> None:
    raise ValueError(f"{constant} is no number")


def _entry(owner: Any, name: str, kind: type) -> Any:
    value = owner.get(name) if isinstance(owner, dict) else None
    if not isinstance(value, kind):
        raise ValueError(f"{name} is missing or not a {kind.__name__}")
    return value


def _read(kind: type[Section], section: str, entries: dict[str, Any], **known: Any) -> Section:
    """A section of the file, every entry of which must be there and of its type, but those known or with a default."""
    fields = {entry.name: entry for entry in dataclasses.fields(kind) if entry.name not in known}
    kinds = {name: str(entry.type) for name, entry in fields.items()}
    for name in entries:
        if name not in kinds:
            raise ValueError(f"{section}: no entry {name!r}{closest(name, kinds)}")
    values = {}
    for name, expected in kinds.items():
        value = entries.get(name, fields[name].default)
        if value is dataclasses.MISSING:
            raise ValueError(f"{section}: {name} is missing")
        types, said = _KINDS[expected]
        items = value if isinstance(value, list) else [value]
        fits = isinstance(value, list) == expected.startswith("tuple")
        fits &= all(type(item) in types for item in items)  # a bool is an int, but not one to take here
        if not fits or (expected == "tuple[float, float]" and len(items) != 2):
            raise ValueError(f"{section}: {name}={value!r}: must be {said}")
        values[name] = tuple(value) if isinstance(value, list) else value
    return kind(**values, **known)
