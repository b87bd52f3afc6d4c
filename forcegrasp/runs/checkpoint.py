"""A checkpoint is one safetensors file: tensors, and JSON in its header. Written whole or not at all; no pickle."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from forcegrasp.errors import CheckpointError
from forcegrasp.files.whole_file import write_whole


def write(path: Path, tensors: dict[str, Tensor], facts: dict[str, Any]) -> None:
    """Writes a checkpoint whole or not at all.

    Args:
      path: where to.
      tensors: contiguous CPU tensors by name.
      facts: whatever JSON can hold.

    Raises:
      CheckpointError: if the disk is full or not writable; an older file of that name is left as it was.
    """
    text = json.dumps(facts, sort_keys=True)
    # One entry: safetensors writes several in random order, and equal checkpoints should be equal files.
    data = save(tensors, metadata={"forcegrasp": json.dumps({"facts": text, "sha256": _digest(tensors, text)})})
    try:
        write_whole(path, data)
    except OSError as error:
        raise CheckpointError(
            f"{path}: could not save the checkpoint ({error.strerror}); free space or set hydra.run.dir"
        ) from error


def read(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Returns the tensors and facts of a checkpoint.

    Raises:
      CheckpointError: if the file is missing, truncated, changed, or no checkpoint.
    """
    try:
        if path.exists() and not path.is_file():
            raise ValueError("not an ordinary file")  # a pipe would be waited for
        with safe_open(path, framework="pt") as file:
            header = json.loads((file.metadata() or {})["forcegrasp"])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        facts, digest = json.loads(header["facts"]), header["sha256"]
        if not isinstance(facts, dict):
            raise ValueError("its facts are no mapping")
    except (OSError, SafetensorError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise CheckpointError(f"{path}: not a readable checkpoint ({error}); remove it to use an older one") from error
    if digest != _digest(tensors, header["facts"]):
        raise CheckpointError(
            f"{path}: checksum differs, the file was changed or damaged; remove it to use an older one"
        )
    return tensors, facts


def _digest(tensors: dict[str, Tensor], text: str) -> str:
    digest = hashlib.sha256(text.encode())
    for name in sorted(tensors):
        digest.update(f"{name} {tensors[name].dtype} {tuple(tensors[name].shape)}".encode())
        digest.update(tensors[name].reshape(-1).contiguous().view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()
