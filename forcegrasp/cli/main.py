"""``forcegrasp VERB [key=value ...]``. What a verb needs is imported when it runs, so that help comes up at once."""

from __future__ import annotations

import importlib
import os
import sys

from forcegrasp import __version__
from forcegrasp.cli.help import help_text
from forcegrasp.cli.options import compose
from forcegrasp.cli.terminal import in_a_line, show_everything
from forcegrasp.cli.verbs import VERBS
from forcegrasp.errors import ForcegraspError, closest

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
        verbs = "\n".join(f"  {verb.name:<11} {verb.purpose}" for verb in VERBS.values())
        print(USAGE.format(version=__version__, verbs=verbs), end="")
        return 0 if arguments else 2
    if arguments[0] == "--version":
        print(__version__)
        return 0
    name, *rest = arguments
    if "--all" in rest:
        rest.append("--help")  # --all alone asks for all of the help, too
    try:
        if name not in VERBS:
            raise ForcegraspError(f"no verb {name!r}{closest(name, VERBS)}")
        for argument in rest:
            if argument != in_a_line(argument):
                told = "a line break, a control character, or bytes that are no text in this locale"
                raise ForcegraspError(f"{argument!r}: has {told}; rename what it names")
        verb = VERBS[name]
        if {"-h", "--help"} & set(rest):
            print(help_text(verb, everything="--all" in rest), end="")
            return 0
        if verb.needs_mujoco:
            import_mujoco()
        return verb.run(rest if verb.reads_arguments else compose(name, rest)) or 0
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
