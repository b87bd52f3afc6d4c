"""``forcegrasp VERB [key=value ...]``. Verbs are imported only when used, so that help comes up at once."""

from __future__ import annotations

import importlib
import os
import sys

from forcegrasp import __version__
from forcegrasp.cli.terminal import in_a_line, show_everything
from forcegrasp.errors import ForcegraspError, closest

VERBS = {
    "record": "make a measurement set from the simulator, with effects hidden in it if you like",
    "compare": "show where a model fails on measured grasps, in units and as a multiple of the sensor noise",
    "fit": "fit a gripper's base model to measured grasps and write it as a file",
    "diagnose": "find out which physical effect a model lacks, and which grasp to record next",
    "add": "add an effect to a model, fit it again, and see the error fall",
    "train": "learn a grasp-force policy with PPO, or resume a run",
    "evaluate": "compare policies and controllers on the same simulated grasps",
    "curves": "draw the learning curves of a sweep, mean and interval over seeds",
    "export": "write a trained policy as a folder that runs on a robot, without torch",
    "render": "play one grasp and show it as a video: the scene, the forces, the object's displacement",
    "effects": "list the physical effects that a simulator may lack, or explain one",
    "doctor": "check this installation and say what to do where something is wrong",
    "completion": "print a script that completes verbs, options and values in bash, zsh or fish",
}

USAGE = """forcegrasp {version}: simulate tactile grasping, train grasp-force controllers, compare them

usage: forcegrasp VERB [key=value ...]

verbs
{verbs}

examples
  forcegrasp train                                         the paper's method, 4.5 million frames
  forcegrasp train experiment=no_ib budget=quick seed=1    an ablation, about five minutes
  forcegrasp train -m experiment=ib,no_ib,no_rand seed=0,1,2 hydra/launcher=joblib
  forcegrasp train -m sweep=ablation                       the method and its ablations, five seeds each
  forcegrasp curves runs/SWEEP                             what they have learned so far
  forcegrasp train resume=runs/RUN                         go on with an interrupted run
  forcegrasp evaluate 'policies=[runs/RUN,force_pi]'
  forcegrasp export runs/RUN out=my_policy                 for a real gripper: numpy and onnxruntime run it
  forcegrasp render policy=force_pi kappa=0.8 out=grasp.gif
  forcegrasp effects backlash                              what it looks like, and what looks like it

from measurements to a better model (a set is a folder of CSV files; forcegrasp record shows one)
  forcegrasp record out=my_set 'effects=[backlash]'        or record your own gripper
  forcegrasp compare data=my_set                           where does the model fail?
  forcegrasp fit data=my_set out=model.yaml
  forcegrasp diagnose data=my_set model=model.yaml         which effect is missing?
  forcegrasp add data=my_set model=model.yaml effect=backlash out=better.yaml
  forcegrasp compare data=my_set model=better.yaml         the error fell

Every verb explains its common options with --help, all of them with --help --all. Exit status: 0 done, 1 the doctor
found something to mend, 2 bad input, 130 interrupted (and saved).
"""


def main(arguments: list[str] | None = None) -> int:
    """Runs one verb; returns the exit status."""
    show_everything()
    arguments = sys.argv[1:] if arguments is None else arguments
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        verbs = "\n".join(f"  {name:<11} {what}" for name, what in VERBS.items())
        print(USAGE.format(version=__version__, verbs=verbs), end="")
        return 0 if arguments else 2
    if arguments[0] == "--version":
        print(__version__)
        return 0
    verb, *rest = arguments
    if "--all" in rest:
        rest.append("--help")  # --all alone asks for all of the help, too
    try:
        if verb not in VERBS:
            raise ForcegraspError(f"no verb {verb!r}{closest(verb, VERBS)}")
        for argument in rest:
            if argument != in_a_line(argument):
                told = "a line break, a control character, or bytes that are no text in this locale"
                raise ForcegraspError(f"{argument!r}: has {told}; rename what it names")
        if verb not in ("doctor", "completion") and not {"-h", "--help"} & set(rest):
            import_mujoco()
        return importlib.import_module(f"forcegrasp.cli.{verb}").main(rest)
    except ImportError as error:
        if (error.name or "").startswith("forcegrasp"):
            raise  # a fault of this project's, not of the installation
        print(
            f"forcegrasp: {' '.join(str(error).split()).rstrip('.')}; see what is wrong with: forcegrasp doctor",
            file=sys.stderr,
        )
        return 2
    except ForcegraspError as error:
        print(f"forcegrasp: {in_a_line(str(error))}", file=sys.stderr)
        return 2
    except OSError as error:
        told = f"{error.filename or 'file system'}: {error.strerror or error}"
        print(f"forcegrasp: {in_a_line(told)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("forcegrasp: interrupted", file=sys.stderr)
        return 130


def import_mujoco() -> None:
    """Imports MuJoCo without an OpenGL backend, which it would load at once, and fail where there is none.

    Videos are rendered in a process of their own, which gets the user's choice of backend.
    """
    asked = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    try:
        importlib.import_module("mujoco")
    finally:
        del os.environ["MUJOCO_GL"]
        if asked is not None:
            os.environ["MUJOCO_GL"] = asked


if __name__ == "__main__":
    sys.exit(main())
