"""Checkpoints that are pickles, or lie about their size, and runs that say odd things about themselves."""

from __future__ import annotations

import io
import json
import struct
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import save

from forcegrasp.evaluate.curves import learning_curves
from forcegrasp.runs import checkpoint
from forcegrasp.runs.policy import load_policy
from forcegrasp.runs.run_dir import RunDir
from forcegrasp.train.loop import train
from tools.reliability.attacks.attack import MARK, Attack, not_files, replace
from tools.reliability.training import BATCHES, last_words, start, status, tiny_config

NAME = Path("run/checkpoints/frames_000000000020.safetensors")
#: Pickles that run a command when they are loaded, protocols 0 and 2.
PICKLES = (
    b"cos\nsystem\n(S'touch " + MARK.encode() + b"'\ntR.",
    b"\x80\x02cposix\nsystem\nq\x00X\x0e\x00\x00\x00touch " + MARK.encode() + b"q\x01\x85q\x02Rq\x03.",
)


def _torch_zip(pickle: bytes) -> bytes:
    """What torch.save writes, with another pickle in it."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as file:
        file.writestr("archive/data.pkl", pickle)
        file.writestr("archive/version", "3\n")
    return buffer.getvalue()


def _header(content: Any, payload: bytes = b"", length: int | None = None) -> bytes:
    text = content if isinstance(content, bytes) else json.dumps(content).encode()
    return struct.pack("<Q", len(text) if length is None else length) + text + payload


def _tensor(shape: list[int], offsets: list[int], dtype: str = "F32") -> dict[str, Any]:
    return {"policy.x": {"dtype": dtype, "shape": shape, "data_offsets": offsets}}


def _facts(text: str) -> bytes:
    """A sound safetensors file with these facts and the right checksum."""
    tensors = {"policy.x": torch.zeros(2)}
    meta = {"facts": text, "sha256": checkpoint._digest(tensors, text)}
    return save(tensors, metadata={"forcegrasp": json.dumps(meta)})


FILES: dict[str, bytes] = {
    **{f"a pickle, {len(p)} bytes": p for p in PICKLES},
    **{f"torch.save of a pickle, {len(p)} bytes": _torch_zip(p) for p in PICKLES},
    "a zip bomb": _torch_zip(b"\0" * 1000) * 1000,
    "a header of 2⁶³ bytes": _header({}, length=2**63),
    "a header of 1 TB": _header({}, length=2**40),
    "a header deep in lists": _header(b"[" * 1_000_000),
    "a tensor of 2⁶² numbers": _header(_tensor([2**31, 2**31], [0, 4]), b"\0" * 4),
    "a tensor of 1 TB": _header(_tensor([2**38], [0, 2**40]), b"\0" * 4),
    "a tensor before the file": _header(_tensor([1], [-4, 0]), b"\0" * 4),
    "a tensor of no kind": _header(_tensor([1], [0, 4], "OBJ"), b"\0" * 4),
    "a tensor that ends first": _header(_tensor([1], [4, 0]), b"\0" * 4),
    "facts deep in lists": _facts("[" * 100_000),
    "facts deep in mappings": _facts('{"a":' * 100_000),
    "facts that are a list": _facts("[1, 2]"),
    "facts that are a number": _facts("9" * 4000),
    "facts of a million digits": _facts(f'{{"frames": {"9" * 1_000_000}}}'),
    "no facts": _facts("{}"),
}

#: Facts of a checkpoint that is otherwise the run's own.
FACTS: dict[str, dict[str, Any]] = {
    "frames of a text": {"frames": "20"},
    "frames below zero": {"frames": -1e300},
    "no batches": {"batches": None},
    "generator of a list": {"rng_grasps": [1, 2]},
    "generator of another kind": {"rng_grasps": {"bit_generator": "os.system", "state": {}}},
}


@cache
def _state() -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    """What a training saves after its first batch."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run"
        assert status(start(path, tiny_config(1, 0, "log.keep=99"))) == 0, last_words(path)
        return checkpoint.read(min((path / "checkpoints").glob("frames_*.safetensors")))


def _run(data: bytes = b"") -> RunDir:
    run = RunDir.create("run", tiny_config(), [])
    NAME.write_bytes(data)
    return run


def _own(tensors: dict[str, torch.Tensor], facts: dict[str, Any]) -> None:
    """A checkpoint that carries the run's fingerprint."""
    run, (sound, said) = _run(), _state()
    checkpoint.write(NAME, {**sound, **tensors}, {**said, "config": run.fingerprint, **facts})


def _resume() -> bool:
    run = RunDir.open("run")
    return train(run.config(), run, resume=True)


WAYS: dict[str, Callable[[], object]] = {
    "resume": _resume,
    "evaluate": lambda: load_policy("run"),
    "evaluate that checkpoint": lambda: load_policy(NAME),
}


def attacks() -> Iterator[Attack]:
    for way, load in WAYS.items():
        for name, data in FILES.items():
            yield Attack(f"{way}: {name}", partial(_run, data), load)
        for name, make in not_files():
            yield Attack(f"{way}: {name}", lambda make=make: (_run(), replace(NAME, make)), load)
    _state()  # once, and not in each process
    for name, facts in FACTS.items():
        yield Attack(f"resume: {name}", partial(_own, {}, facts), _resume, seconds=20)
    for name in (
        "policy.module.0.module.0.weight",
        "rng.torch",
        "rng.shuffle",
        "optimizer.x.y",
        "env.__class__",
        "env.os",
    ):
        for tensor in (torch.zeros(0), torch.zeros(3, 3), torch.zeros(5056, dtype=torch.int8)):
            lay = partial(_own, {name: tensor}, {})
            kept = name.startswith("rng") and tensor.dtype == torch.int8
            yield Attack(f"resume: {name} of {tuple(tensor.shape)}", lay, _resume, not kept, seconds=20)
    for name, text in {
        "deep": '{"command": ' + "[" * 100_000,
        "a script": '{"command": ["experiment=<script>alert(1)</script>"]}',
        "bad mathematics": '{"command": ["experiment=$\\\\frac{1$"]}',
        "a path": '{"command": ["experiment=../../outside/x"]}',
        "a number": '{"command": 3}',
        "control characters": '{"command": ["experiment=\\u0000\\u001b[31m"]}',
    }.items():
        yield Attack(f"curves: run.json of {name}", partial(_finished, text), _curves, False, seconds=30)
    for name, make in not_files():
        lay = lambda make=make: (_finished("{}"), replace(Path("run/metrics.csv"), make))  # noqa: E731
        yield Attack(f"curves: metrics.csv is {name}", lay, _curves, name != "a link to nowhere", seconds=10)
        lay = lambda make=make: (_finished("{}"), replace(Path("run/run.json"), make))  # noqa: E731
        yield Attack(f"curves: run.json is {name}", lay, _curves, False, seconds=30)


def _finished(about: str) -> None:
    run = _run()
    (run.path / "run.json").write_text(about)
    columns = ("episode/force_reward_normalised", "episode/force_reward_paper", "episode/fast_steps")
    for number in range(BATCHES):
        row = {"frames": 20 * (number + 1)} | dict.fromkeys(columns, 1.0)
        run.log_metrics(row | {"episode/displacement_until_grasped_mm": 1.0})


def _curves() -> None:
    Path("out").mkdir()
    learning_curves([Path()], Path("out"))
