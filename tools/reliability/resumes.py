"""Trainings that are killed again and again, and resumed, against one that nobody touched."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from forcegrasp.runs.run_dir import RunDir
from tools.reliability.training import ending, go_on, kill_after, last_words, start, status, tiny_config
from tools.reliability.trial import Promise, Trial

#: What makes the trainings differ.
VARIANTS = (
    (),
    ("experiment=no_ib", "ppo.critic=observation"),
    ("experiment=no_noise", "ppo.entropy_weight=0.01"),
    ("model=virtual_robot", "observation.frames=1"),
)


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Each kills a training up to three times; its end must be that of the whole one, to the last bit."""
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            whole, broken = (RunDir(Path(folder) / f"{name} {number}") for name in ("whole", "broken"))
            config = tiny_config(int(rng.integers(1, 4)), number, *VARIANTS[number % len(VARIANTS)])
            started = time.monotonic()
            assert status(start(whole.path, config)) == 0
            seconds = time.monotonic() - started
            ended = kill_after(start(broken.path, config), float(rng.uniform(0.3, 1) * seconds))
            kills = int(ended < 0)
            while kills < 3 and broken.config_path.exists():
                kills += kill_after(go_on(broken.path), float(rng.uniform(0.3, 1) * seconds)) < 0
                if rng.random() < 0.3:
                    break
            # killed before it was a run: the same again
            last = go_on(broken.path) if broken.config_path.exists() else start(broken.path, config)
            if ended := status(last):
                problem = f"exit status {ended} of the resumed training: {last_words(broken.path)}"
            else:
                same = [a == b for a, b in zip(ending(whole), ending(broken), strict=True)]
                problem = "" if all(same) else f"{'metrics' if same[0] else 'checkpoints'} differ"
            yield Trial(f"seed {number}, {kills} kills", problem, f"{kills} kills")


PROMISE = Promise("a resumed training ends with the same bits as an uninterrupted one", 20, 1, trials)
