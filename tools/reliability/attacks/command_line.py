"""Options that name Python objects, or have Hydra read files of the attacker's."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from forcegrasp.cli.main import main
from forcegrasp.errors import ForcegraspError
from tools.reliability.attacks.attack import MARK, Attack

OPTIONS = [
    "_target_=os.system",
    "+_target_=os.system",
    "ppo._target_=os.system",
    "+ppo._target_=os.system",
    "++ppo={_target_:os.system}",
    "ppo.hidden={_target_:os.system}",
    f"model='!!python/object/apply:os.system [touch {MARK}]'",
    "model=${oc.env:HOME}",
    "model=../outside/secret",
    "model=/dev/zero",
    "model=/etc/passwd",
    "resume=../outside",
    "resume=/etc",
    "experiment=../../outside/secret",
    "experiment=/etc/passwd",
    "+experiment=evil",
    "sweep=../evil",
    "--config-dir=evil",
    "--config-path=evil",
    "--config-name=evil",
    "-cd",
    "hydra/launcher=../evil",
    "hydra/launcher=evil",
    "hydra.callbacks={evil:{}}",
    "hydra.sweeper.params={seed:1}",
]
#: Together they would have Hydra build an object that a file names.
CALLBACK = ["hydra.searchpath=[file://evil]", "hydra/callbacks=evil"]


def attacks() -> Iterator[Attack]:
    for option in OPTIONS:
        for multirun in ([], ["-m"]):
            arguments = ["train", *multirun, option, "ppo.total_frames=1"]
            yield Attack(" ".join(arguments[:-1]), _lay, partial(_refused, arguments), seconds=20)
    for verb in ("train", "evaluate", "record"):
        arguments = [verb, *CALLBACK, *(["-m", "seed=0,1", "ppo.total_frames=1"] if verb == "train" else [])]
        yield Attack(f"{verb} {' '.join(CALLBACK)}", _lay, partial(_refused, arguments), seconds=20)
    for verb in ("evaluate", "render", "export", "compare", "fit", "diagnose", "record"):
        yield Attack(f"{verb} _target_", _lay, partial(_refused, [verb, "+_target_=os.system"]), seconds=20)
    for name in ("../outside/secret", "/etc/passwd", "/dev/zero", "evil"):
        yield Attack(f"evaluate {name}", _lay, partial(_refused, ["evaluate", f"policies=[{name}]"]), seconds=20)
        yield Attack(f"compare {name}", _lay, partial(_refused, ["compare", f"data={name}"]), seconds=20)
        yield Attack(f"objects {name}", _lay, partial(_refused, ["evaluate", f"objects={name}"]), seconds=20)


def _lay() -> None:
    for folder in (Path("evil"), Path("evil/experiment"), Path("evil/hydra/callbacks")):
        folder.mkdir(parents=True)
        (folder / "evil.yaml").write_text(f"_target_: os.system\n_args_: ['touch {MARK}']\n")
    callback = f"evil:\n  _target_: os.system\n  command: touch {MARK}\n"
    (Path("evil") / "hydra" / "callbacks" / "evil.yaml").write_text(callback)
    (Path("evil") / "config.yaml").write_text(f"_target_: os.system\n_args_: ['touch {MARK}']\n")


def _refused(arguments: list[str]) -> None:
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        status = main(arguments)
    if status == 2 and said.getvalue().count("\n") == 1 and said.getvalue().startswith("forcegrasp: "):
        raise ForcegraspError("refused")
    raise AssertionError(f"exit status {status}, said {said.getvalue()[:200]!r}")
