"""Promises that the test suite keeps, test by test: options, transforms, mistakes on the command line, sweeps."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from tools.reliability.trial import Promise, Trial

ROOT = Path(__file__).resolve().parents[2]
SUITES = {
    "every option and every parameter of an effect changes something; unknown ones are refused": [
        "tests/config/test_options_of_train.py",
        "tests/config/test_options_of_evaluate.py",
        "tests/config/test_options_of_render.py",
        "tests/config/test_options_of_measuring.py",
        "tests/config/test_options_of_small_verbs.py",
        "tests/config/test_validate.py",
        "tests/effects/test_effect_contract.py",
    ],
    "each transform, and all together, alone, serial, parallel and in a batch: the same bits": [
        "tests/transforms/test_transform_contract.py",
        "tests/transforms/test_composition.py",
        "tests/env/test_build_env.py",
    ],
    "a mistake on the command line is answered in one line that says what to do": [
        "tests/cli/test_bad_input.py",
        "tests/cli/test_measuring_verbs.py",
    ],
    "a run of a sweep that fails takes no other along, and is named at the end": ["tests/cli/test_sweep.py"],
    "nothing that is read can run code: no pickle, no torch.load, no eval": ["tests/runs/test_no_code_in_files.py"],
}


def trials(count: int, seed: int) -> Iterator[Trial]:
    """Each is a test; ``count`` and ``seed`` change nothing."""
    del count, seed
    for promise, paths in SUITES.items():
        with tempfile.TemporaryDirectory() as folder:
            report = Path(folder) / "report.xml"
            command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--junitxml={report}", *paths]
            said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout
            if not report.is_file():
                yield Trial(promise, said[-300:], promise)
                continue
            for case in ElementTree.parse(report).iter("testcase"):
                wrong = [found.get("message", "")[:200] for found in case if found.tag in ("failure", "error")]
                yield Trial(f"{case.get('classname')}::{case.get('name')}", " ".join(wrong), promise)


PROMISE = Promise("what the test suite holds, promise by promise", 0, 0, trials)
