"""Checkpoints: what is written is read, or refused; a failed write leaves the older file as it was."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from forcegrasp.errors import CheckpointError
from forcegrasp.files import whole_file
from forcegrasp.runs import checkpoint

FACTS = {"frames": 3, "name": "κ → 1", "nested": {"big": 2**100, "list": [1, None, 0.1]}}


def tensors(seed: int = 0) -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    return {
        "weight": torch.randn(2, 3, generator=generator),
        "double": torch.randn(1, dtype=torch.float64, generator=generator),
        "scalar": torch.tensor(2.5),
        "rng": generator.get_state()[:16].clone(),
        "empty": torch.zeros(0, 4),
    }


def same(one: dict[str, torch.Tensor], other: dict[str, torch.Tensor]) -> bool:
    return one.keys() == other.keys() and all(
        one[k].dtype == other[k].dtype and torch.equal(one[k], other[k]) for k in one
    )


@pytest.fixture
def saved(tmp_path) -> Path:
    path = tmp_path / "a.safetensors"
    checkpoint.write(path, tensors(), FACTS)
    return path


def refused(path: Path, message: str | None = None) -> None:
    with pytest.raises(CheckpointError, match=message) as caught:
        checkpoint.read(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_round_trip(saved):
    loaded, facts = checkpoint.read(saved)
    assert same(loaded, tensors())
    assert facts == FACTS
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def test_not_a_number_survives(tmp_path):
    checkpoint.write(tmp_path / "a.safetensors", {"x": torch.tensor([torch.nan, torch.inf, -0.0])}, {})
    loaded, _ = checkpoint.read(tmp_path / "a.safetensors")
    assert torch.equal(loaded["x"].view(torch.int32), torch.tensor([torch.nan, torch.inf, -0.0]).view(torch.int32))


def test_equal_states_give_equal_files(saved, tmp_path):
    # in another order, and many times, because dictionaries and hashes may be ordered at random
    for index in range(20):
        path = tmp_path / f"{index}.safetensors"
        checkpoint.write(path, dict(reversed(tensors().items())), dict(reversed(FACTS.items())))
        assert path.read_bytes() == saved.read_bytes()
    checkpoint.write(path, tensors(1), FACTS)
    assert path.read_bytes() != saved.read_bytes()


def test_every_truncation_is_refused(saved):
    data = saved.read_bytes()
    for length in range(len(data)):
        saved.write_bytes(data[:length])
        refused(saved)
    saved.write_bytes(data + b"\0")
    refused(saved)


def test_no_flipped_bit_goes_unnoticed(saved):
    data = saved.read_bytes()
    for position in range(len(data)):
        changed = bytearray(data)
        changed[position] ^= 1 << position % 8
        saved.write_bytes(changed)
        try:
            loaded, facts = checkpoint.read(saved)
        except CheckpointError:
            continue
        assert same(loaded, tensors()), f"byte {position}"
        assert facts == FACTS, f"byte {position}"


@pytest.mark.parametrize(
    ("old", "new"),
    [(b'"shape":[2,3]', b'"shape":[3,2]'), (b'"F32","shape":[2,3]', b'"I32","shape":[2,3]'), (b"[0,4]", b"[0,5]")],
)
def test_changed_shape_or_type_is_refused(saved, old, new):
    data = saved.read_bytes()
    assert old in data
    saved.write_bytes(data.replace(old, new))
    refused(saved)


def test_payload_of_another_checkpoint_is_refused(saved):
    other = saved.with_name("b.safetensors")
    checkpoint.write(other, tensors(1), FACTS)
    one, two = saved.read_bytes(), other.read_bytes()
    payload = sum(tensor.numel() * tensor.element_size() for tensor in tensors().values())
    saved.write_bytes(one[:-payload] + two[-payload:])
    refused(saved, "checksum")


def metadata(text: str) -> dict[str, str]:
    return {"forcegrasp": text}


@pytest.mark.parametrize(
    "meta",
    [
        None,
        {"format": "pt"},
        metadata(""),
        metadata("{"),
        metadata("3"),
        metadata("[]"),
        metadata("null"),
        metadata("{}"),
        metadata('{"facts": 1, "sha256": "x"}'),
        metadata('{"facts": "{}"}'),
        metadata('{"facts": "{}", "sha256": null}'),
        metadata('{"facts": "[]", "sha256": "0"}'),
        metadata("[" * 100_000),
    ],
)
def test_foreign_safetensors_are_refused(tmp_path, meta):
    save_file({"x": torch.zeros(3)}, tmp_path / "a.safetensors", metadata=meta)
    refused(tmp_path / "a.safetensors")


@pytest.mark.parametrize(
    "content", [b"", b"\0" * 100, b"PK\x03\x04" + b"x" * 50, b"\x80\x04.", b'{"a": 1}', b"\xff" * 64, b"text\n" * 99]
)
def test_other_files_are_refused(tmp_path, content):
    path = tmp_path / "a.safetensors"
    path.write_bytes(content)
    refused(path, "not a readable checkpoint")


def test_missing_file_and_folder_are_refused(tmp_path):
    refused(tmp_path / "none.safetensors")
    refused(tmp_path)


def no_space(*args, **kwargs):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


class FullDisk:
    """A file on a disk that is full after a few bytes."""

    def __init__(self, path, mode):
        self.file = open(path, mode)  # noqa: SIM115

    def __enter__(self):
        return self

    def __exit__(self, *args):
        self.file.close()

    def write(self, data):
        self.file.write(data[:100])
        self.file.flush()
        no_space()


def fails_at_open(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(whole_file, "open", no_space, raising=False)


def fails_at_write(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(whole_file, "open", FullDisk, raising=False)


def fails_at_sync(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(os, "fsync", no_space)


def fails_at_rename(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(os, "replace", no_space)


@pytest.mark.parametrize("fails", [fails_at_open, fails_at_write, fails_at_sync, fails_at_rename])
def test_full_disk_leaves_the_older_file(saved, monkeypatch, fails: Callable):
    before = saved.read_bytes()
    with monkeypatch.context() as patch:
        fails(patch)
        with pytest.raises(CheckpointError, match="No space left") as caught:
            checkpoint.write(saved, tensors(1), FACTS)
    assert str(saved) in str(caught.value)
    assert saved.read_bytes() == before
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]
    checkpoint.write(saved, tensors(1), FACTS)
    assert same(checkpoint.read(saved)[0], tensors(1))


def test_stale_part_is_overwritten(saved):
    part = saved.with_suffix(".part")
    part.write_bytes(b"left behind by a power cut" * 1000)
    checkpoint.write(saved, tensors(1), FACTS)
    assert same(checkpoint.read(saved)[0], tensors(1))
    assert not part.exists()


def test_synced_before_it_is_renamed(tmp_path, monkeypatch):
    done = []
    sync, rename = os.fsync, os.replace
    monkeypatch.setattr(os, "fsync", lambda fd: (done.append(("sync", os.fstat(fd).st_size)), sync(fd))[1])
    monkeypatch.setattr(os, "replace", lambda a, b: (done.append(("rename", Path(a).stat().st_size)), rename(a, b))[1])
    checkpoint.write(tmp_path / "a.safetensors", tensors(), FACTS)
    size = (tmp_path / "a.safetensors").stat().st_size
    assert done[:2] == [("sync", size), ("rename", size)]


def test_header_is_plain_json(saved):
    data = saved.read_bytes()
    header = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])
    assert set(header["__metadata__"]) == {"forcegrasp"}


def test_pipe_is_refused(tmp_path):
    os.mkfifo(tmp_path / "a.safetensors")
    refused(tmp_path / "a.safetensors", "not an ordinary file")


def test_facts_that_are_no_mapping_are_refused(tmp_path):
    checkpoint.write(tmp_path / "a.safetensors", {}, [1, 2])  # pyright: ignore[reportArgumentType]
    refused(tmp_path / "a.safetensors", "no mapping")
