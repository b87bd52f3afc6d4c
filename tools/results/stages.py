"""All stages, in the order in which they run."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from forcegrasp.config import AlgorithmConfig
from tools.results.policies import CONTROLLERS, POLICIES, SWEEPS, Policy, Sweep
from tools.results.settings import Settings
from tools.results.stage import Stage

#: Control steps of an episode; cells and grasps of the lists of softness and of objects.
STEPS, SOFTNESS, OBJECTS, TRIALS, ON_OBJECT, FEW = 150, 11, 6, 200, 20, 50
#: Seed of the grasps on which the shipped seed is chosen: others than those that pages show.
DEVELOPMENT = 2000
#: As many trainings at once as there are cores, a core each: one alone leaves cores idle while it learns.
_SIDE_BY_SIDE = ("hydra/launcher=joblib", "physics.threads=1")
#: Nobody looks at these while it trains.
_NO_PICTURES = ("log.video_every=0", "log.figures_every=0")


#: Those of the policies in the package that pages compare.
_OF_PACKAGE = ("ship-recommended", "ship-ib", "ship-no_ib", "ship-no_rand")


def stages(settings: Settings) -> dict[str, Stage]:
    """Stages by name."""
    every = [
        _virtual_robot(settings),
        *(stage for policy in POLICIES for stage in _of_policy(policy, settings)),
        *(stage for name, sweep in SWEEPS.items() for stage in _of_sweep(name, sweep, settings)),
        _controllers(settings),
        *_pictures(settings),
        *_other_programs(settings),
    ]
    return {stage.name: stage for stage in every if not (stage.writes_docs and settings.trial)}


def _train(folder: str, options: str, settings: Settings) -> tuple[tuple[str, ...], int, int]:
    """The command of a training with all seeds, how many runs it has, and their control steps."""
    algorithm, count = _asked_for(tuple(word for word in options.split() if not word.startswith("model=")))
    budget = (f"{algorithm.name}.total_frames={settings.frames}",) if settings.frames else ()
    command = (
        *("forcegrasp", "train", "-m", *options.split(), _seeds(settings), *_SIDE_BY_SIDE, *_NO_PICTURES, *budget),
        f"hydra.sweep.dir={settings.shown(folder)}",
    )
    runs = count * settings.seeds
    return command, runs, runs * (settings.frames or algorithm.total_frames)


@cache
def _asked_for(options: tuple[str, ...]) -> tuple[AlgorithmConfig, int]:
    """The learning algorithm, and how many experiments a sweep has."""
    from forcegrasp.cli.options import compose  # Hydra takes seconds, and the check of pages can do without
    from forcegrasp.cli.sweep import single_runs

    runs = single_runs([*options, "seed=0,1"])
    named = {word for run in runs for word in run if word.startswith("experiment=")}
    return compose("train", runs[0]).algorithm, max(1, len(named))


def _seeds(settings: Settings) -> str:
    return f"seed={','.join(str(seed) for seed in range(1, settings.seeds + 1))}"


def _evaluate(name: str, settings: Settings, out: str, *options: str) -> tuple[str, ...]:
    trials = () if settings.trials is None else (f"trials={settings.trials}",)
    kept = (option for option in options if not (trials and option.startswith("trials=")))
    return ("forcegrasp", "evaluate", *kept, *trials, f"out={settings.shown(name, out)}")


def _episodes(policies: int, cells: int, trials: int, settings: Settings) -> int:
    return policies * cells * (settings.trials or trials) * STEPS


def _virtual_robot(settings: Settings) -> Stage:
    robot = settings.shown("virtual-robot")
    return Stage(
        "virtual-robot",
        "a set of the virtual robot, and the model that a diagnosis makes of it",
        (
            ("forcegrasp", "record", "model=virtual_robot", "objects=6", f"out={robot}/set"),
            ("forcegrasp", "diagnose", f"data={robot}/set", f"out={robot}/why"),
        ),
        code="diagnosis",
        hours=0.3,
    )


def _of_policy(policy: Policy, settings: Settings) -> Iterator[Stage]:
    """All seeds trained, all seeds evaluated, the best one shipped."""
    name, code = policy.name, policy.code
    train, evaluate = f"train-{name}", f"evaluate-{name}"
    model = f" model={settings.shown('virtual-robot', 'why', 'model.yaml')}" if policy.of_robot else ""
    command, _, frames = _train(train, policy.options + model, settings)
    yield Stage(
        train,
        f"{settings.seeds} seeds of {name}",
        (command,),
        needs=("virtual-robot",) if policy.of_robot else (),
        code=code,
        trained=frames,
    )
    runs = f"policies=[{settings.shown(train)}/*,force_pi]"
    many, on_objects = settings.seeds + 1, _episodes(settings.seeds + 1, OBJECTS, ON_OBJECT, settings)
    plan = ("plan=virtual_robot",) if policy.of_robot else (f"trials={FEW}",)
    chosen_on = on_objects if policy.of_robot else _episodes(many, SOFTNESS, FEW, settings)
    yield Stage(
        evaluate,
        f"how well each seed of {name} does, and on the grasps of which one is chosen",
        (
            _evaluate(evaluate, settings, "development", runs, *plan, f"seed={DEVELOPMENT}"),
            _evaluate(evaluate, settings, "softness", runs, f"trials={TRIALS}"),
            _evaluate(evaluate, settings, "objects", runs, "plan=objects"),
            _evaluate(evaluate, settings, "robot", runs, "plan=virtual_robot"),
        ),
        needs=(train,),
        code=code,
        evaluated=chosen_on + _episodes(many, SOFTNESS, TRIALS, settings) + 2 * on_objects,
    )
    yield Stage(
        f"ship-{name}",
        f"the best seed of {name} in the package, with its card",
        (("python", "-m", "tools.results.ship", name, settings.shown(), _into(settings)),),
        needs=(evaluate,),
        code=code,
    )


def _into(settings: Settings) -> str:
    return settings.shown("pages") if settings.trial else "."


def _of_sweep(name: str, sweep: Sweep, settings: Settings) -> Iterator[Stage]:
    train, evaluate = f"train-{name}", f"evaluate-{name}"
    command, trained, frames = _train(train, sweep.options, settings)
    yield Stage(train, f"{settings.seeds} seeds of {sweep.options}", (command,), trained=frames)
    trainings = (*(f"train-{policy}" for policy in sweep.beside), train)
    runs = [settings.shown(training) for training in trainings]
    listed = ",".join([f"{folder}/*" for folder in runs])
    yield Stage(
        evaluate,
        f"how well those of {name} do, and their learning curves",
        (
            _evaluate(evaluate, settings, "softness", f"policies=[{listed},force_pi]", f"trials={FEW}"),
            ("forcegrasp", "curves", *runs, f"out={settings.shown(evaluate, 'curves')}"),
        ),
        needs=trainings,
        evaluated=_episodes(trained + settings.seeds * len(sweep.beside) + 1, SOFTNESS, FEW, settings),
    )


def _controllers(settings: Settings) -> Stage:
    name, who = "evaluate-controllers", f"policies=[{','.join(CONTROLLERS)}]"
    on_objects = 2 * _episodes(2, OBJECTS, ON_OBJECT, settings)
    return Stage(
        name,
        "how well the hand-written controllers do",
        (
            _evaluate(name, settings, "softness", who, f"trials={TRIALS}"),
            _evaluate(name, settings, "objects", who, "plan=objects"),
            _evaluate(name, settings, "robot", who, "plan=virtual_robot"),
        ),
        evaluated=_episodes(2, SOFTNESS, TRIALS, settings) + on_objects,
    )


def _shipped(settings: Settings, *names: str) -> str:
    """Policies that were shipped, which a trial's are not, and controllers."""
    folder = settings.shown("pages", "forcegrasp", "policies") + "/" if settings.trial else ""
    policies = {policy.name for policy in POLICIES}
    return f"policies=[{','.join(folder * (name in policies) + name for name in names)}]"


def _pictures(settings: Settings) -> Iterator[Stage]:
    """Those of the policies that were shipped, and of the ablations."""
    copy = ("python", "-m", "tools.results.pictures", settings.shown(), _into(settings))
    paper, users = ("ib", "no_ib", "no_rand", "force_pi"), ("recommended", "ib", "force_pi", "informed")
    yield Stage(
        "pictures",
        "box plots and force traces of the pages",
        (
            _evaluate("pictures", settings, "paper", _shipped(settings, *paper), f"trials={TRIALS}"),
            _evaluate("pictures", settings, "users", _shipped(settings, *users), f"trials={TRIALS}"),
            (*copy, "pictures"),
        ),
        needs=_OF_PACKAGE,
        evaluated=_episodes(len(paper) + len(users), SOFTNESS, TRIALS, settings),
    )
    on_robots = _shipped(
        settings, "catalogue", *(name for name in paper if name != "force_pi"), "recommended", *CONTROLLERS
    )
    yield Stage(
        "robots",
        "policies on a hundred robots that nobody measured",
        (
            _evaluate("robots", settings, "evaluation", "plan=robots", "physics=fast", on_robots),
            (*copy, "robots"),
        ),
        needs=_OF_PACKAGE,
        hours=0.1,
    )
    ablation = "evaluate-ablation"
    yield Stage("curves-picture", "learning curves of the ablations", ((*copy, ablation),), needs=(ablation,))
    who = _shipped(settings, "ib_virtual_robot", "ib", "force_pi")
    grasp = ("kappa=0.4", "radius_m=0.0158", "offset_m=-0.0037", "goal_force_n=0.76")
    video = settings.shown("render-transfer", "grasp.gif")
    yield Stage(
        "render-transfer",
        "one grasp on the virtual robot; needs OpenGL",
        (
            ("forcegrasp", "render", who, "model=virtual_robot", *grasp, f"out={video}"),
            (*copy, video, "transfer_grasp.png"),
        ),
        needs=("ship-ib_virtual_robot", "ship-ib"),
        code="diagnosis",
    )


def _other_programs(settings: Settings) -> Iterator[Stage]:
    """Programs that write pages or figures of their own; hours are those of two cores."""
    folder = ("--out", settings.shown("grippers"))
    of_grippers = ("train", "diagnose", "report", "picture")
    grippers = (("python", "tools/grippers.py", "--stage", stage, *folder) for stage in of_grippers)
    hidden = (("python", "tools/hidden_effects.py", *words) for words in (("run", "--renew"), ("report",)))

    def stage(name: str, makes: str, hours: float, *commands: tuple[str, ...], needs: tuple[str, ...] = ()) -> Stage:
        return Stage(name, makes, commands, needs, "diagnosis", hours=hours, writes_docs=True)

    readme = ("python", "tools/readme_pictures.py")
    yield stage("readme-pictures", "moving pictures of the README", 0.1, readme, needs=("ship-ib",))
    yield stage("paper-figures", "docs/calibration.md", 0.1, ("python", "tools/paper_figures.py"))
    yield stage("physics-figures", "figures of docs/physics.md", 0.1, ("python", "tools/physics_figures.py"))
    yield stage("object-motion-gap", "a figure of docs/real-table.md", 0.2, ("python", "tools/object_motion_gap.py"))
    yield stage("real-table", "a figure of docs/real-table.md", 0.1, ("python", "tools/real_table.py"))
    yield stage("tutorial", "docs/tutorial.md and its notebook", 0.2, ("python", "tools/tutorial_notebook.py"))
    yield stage("compare-page", "docs/compare-your-data.md", 0.3, ("python", "tools/tutorial_figures.py"))
    yield stage("effect-pages", "docs/effects", 0.3, ("python", "tools/effect_pages.py"))
    measured = ("python", "tools/measured_robots.py", "--out", settings.shown("measured-robots"))
    yield stage("measured-robots", "a table of docs/robots.md", 3, measured, needs=("ship-ib",))
    yield stage("grippers", "docs/grippers.md", 6, *grippers)
    yield stage("hidden-effects", "docs/hidden-effects.md", 17, *hidden)
    if settings.real_data:
        command = ("python", "-m", "tools.real_data", "--data", str(settings.real_data.resolve()))
        where = ("--out", settings.shown("real-data"), "--page", "docs/real-data.md")
        yield stage("real-data", "docs/real-data.md", 3, (*command, *where))
