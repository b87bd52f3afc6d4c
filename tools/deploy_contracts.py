"""Writes forcegrasp/assets/force_pi: the contract of the hand-written controller for every gripper of the package.

    python tools/deploy_contracts.py [FOLDER]

A robot's computer has no simulator and can't derive them from the descriptions itself. Run it after a change of one.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from forcegrasp.deploy.contract_file import FORCE_PI, shipped_contracts
from forcegrasp.physics.gripper_file import load_gripper, shipped_grippers
from forcegrasp.runs.export import export_policy


def write_contracts(folder: Path) -> None:
    """Writes a folder for each gripper whose forces are read."""
    for name in shipped_grippers():
        if load_gripper(name).forces:
            shutil.rmtree(folder / name, ignore_errors=True)
            print(export_policy(FORCE_PI, folder / name, gripper=name).contract)


if __name__ == "__main__":
    write_contracts(Path(sys.argv[1]) if len(sys.argv) > 1 else shipped_contracts())
