"""Common mistakes: one line that says what is wrong and what to do, exit status 2, and nothing written."""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from forcegrasp.cli.main import main
from forcegrasp.runs.lock import only_writer

#: (arguments, what the line must tell). Train and evaluate are made quick, should they start after all.
MISTAKES = [
    # verbs
    (["trian"], "did you mean train"),
    (["eval"], "did you mean evaluate"),
    (["seed=1"], "no verb 'seed=1'"),
    (["--version=1"], "no verb"),
    (["effect"], "did you mean effects"),
    (["effects", "backlsh"], "did you mean backlash"),
    (["effects", "friction"], "load_friction"),
    (["effects", ""], "forcegrasp effects lists them"),
    (["effects", "backlash", "adhesion"], "one name at a time"),
    # presets
    (["train", "experiment=no_id"], "did you mean no_ib"),
    (["train", "experiment="], "known: catalogue, ib, ib_tuned"),
    (["train", "physics=quick"], "known: fast, reference"),
    (["train", "reward=normalised"], "goal_normalised"),
    (["train", "sensors=noisy"], "authors, paper"),
    (["train", "+experiment=ib"], "experiment"),
    (["train", "~experiment"], "experiment"),
    (["evaluate", "experiment=ib"], "no option 'experiment'"),
    # names of options
    (["train", "ppo.learning_rat=1"], "did you mean ppo.learning_rate"),
    (["train", "learning_rate=1"], "ppo.learning_rate"),
    (["train", "gasp.kappa=[0,1]"], "grasp.kappa"),
    (["train", "ppo=3"], "no option 'ppo'"),
    (["train", "+ppo.new=1"], "no option"),
    (["train", "++ppo.grasps=4"], "ppo.grasps"),
    (["train", "~ppo.grasps"], "ppo.grasps"),
    (["train", "Seed=1"], "did you mean seed"),
    (["train", " seed=1"], "did you mean seed"),
    (["evaluate", "polices=[force_pi]"], "did you mean policies"),
    (["evaluate", "ppo.grasps=3"], "no option 'ppo.grasps'"),
    (["evaluate", "resume=runs/x"], "no option 'resume'"),
    # form
    (["train", "seed"], "key=value"),
    (["train", "experiment", "no_ib"], "key=value"),
    (["train", "--experiment", "no_ib"], "key=value"),
    (["train", "--seed=1"], "did you mean seed"),
    (["train", ""], "key=value"),
    (["train", "=1"], "no option ''"),
    (["train", "seed==1"], "seed"),
    (["train", "grasp.kappa=[0,1"], "kappa"),
    (["evaluate", "force_pi"], "key=value"),
    (["evaluate", "-m", "seed=1,2"], "key=value"),
    # values
    (["train", "ppo.grasps=-1"], "ppo.grasps=-1: must lie in [1, 100000]"),
    (["train", "ppo.grasps=0"], "must lie in"),
    (["train", "ppo.grasps=1.5"], "ppo.grasps"),
    (["train", "ppo.grasps=many"], "Integer"),
    (["train", "ppo.grasps="], "ppo.grasps"),
    (["train", "seed=-1"], "seed=-1"),
    (["train", "seed=true"], "seed"),
    (["train", "seed=99999999999"], "seed=99999999999"),
    (["train", "ppo.total_frames=-5"], "ppo.total_frames"),
    (["train", "ppo.learning_rate=nan"], "ppo.learning_rate=nan"),
    (["train", "ppo.learning_rate=null"], "ppo.learning_rate"),
    (["train", "ppo.hidden=wide"], "ppo.hidden"),
    (["train", "ppo.hidden=[]"], "must not be empty"),
    (["train", "ppo.hidden=[[8]]"], "ppo.hidden"),
    (["train", "ppo.critic=all"], "one of observation, privileged"),
    (["train", "collector=rays"], "did you mean ray"),
    (["train", "collector.workers=2"], "add collector=ray"),
    (["train", "collector=ray", "collector.workers=3"], "can't be shared equally"),
    (["train", "collector=ray", "collector.address=head"], "must be one of local, auto"),
    (["train", "action.inductive_bias=perhaps"], "action.inductive_bias"),
    (["train", "grasp.kappa=[1,0]"], "low ≤ high"),
    (["train", "grasp.kappa=0.5"], "grasp.kappa"),
    (["train", "grasp.kappa=[0.5]"], "[low, high]"),
    (["train", "grasp.kappa=[0,2]"], "must lie in [0, 1]"),
    (["train", "grasp.kappa=[a,b]"], "grasp.kappa"),
    (["train", "grasp.offset_m=[0.01,-0.01]"], "low ≤ high"),
    (["train", "grasp.deformation_m=0.02"], "eq. 3"),
    (["train", "curriculum.radius_m=[0.0125,0.02]", "grasp.deformation_m=0.014"], "curriculum.radius_m"),
    (["train", "physics.device=cuda"], "physics.device=cuda: engine mujoco runs on the CPU; add physics=warp"),
    (["train", "physics=warp", "physics.device=cuda", "collector=ray"], "Ray's workers have no GPU"),
    (["evaluate", "physics.device=tpu"], "must be one of cpu, cuda"),
    (
        ["train", "physics=warp", "model=virtual_robot"],
        "model=virtual_robot: engine warp simulates the nominal gripper",
    ),
    (["train", "randomise=model"], "randomise=model: there is none to draw from; name one with model=FILE"),
    (["train", "randomise=none", "model=virtual_robot"], "model=virtual_robot is drawn from, too; leave one of them"),
    (["train", "randomise=catalogue", "model=virtual_robot"], "randomise=catalogue: model=virtual_robot is drawn"),
    (["train", "randomise=catalogue", "physics=warp"], "randomise=catalogue: engine warp simulates the nominal"),
    (["evaluate", "plan=robots", "physics=warp"], "robots=100: engine warp simulates the nominal gripper alone"),
    (["evaluate", "robots=3"], "robots=3: takes 4 at least, two of them for the test"),
    (["evaluate", "plan=robots", "model=virtual_robot"], "robots=100: model=virtual_robot is a robot, too; leave one"),
    (["evaluate", "physics=warp", "plan=virtual_robot"], "model=virtual_robot: engine warp simulates the nominal"),
    (["render", "physics.engine=warp", "model=virtual_robot"], "use physics.engine=mujoco"),
    (["train", "observation.parts=[]"], "must not be empty"),
    (["train", "observation.parts=[forces]"], "must be one of position"),
    (["train", "observation.parts=[force,force]"], "twice"),
    (["train", "seed=${nope}"], "nope"),
    (["train", "seed=0,1"], "-m"),
    (["train", "experiment=ib,no_ib"], "-m"),
    (["evaluate", "trials=1"], "trials=1: must lie in [2"),
    (["evaluate", "kappas=0"], "kappas=0"),
    (["evaluate", "grasp.radius_m=[0.03,0.02]"], "low ≤ high"),
    (["evaluate", "grasp.deformation_m=0.02"], "eq. 3"),
    # Hydra's own
    (["train", "hydra.run.dri=x"], "hydra.run.dri"),
    (["train", "hydra=3"], "hydra"),
    (["train", "hydra/launcher=jobli"], "jobli"),
    (["train", "hydra.run.dir="], "hydra.run.dir"),
    (["train", "hydra.searchpath=[file:///tmp]"], "no option 'hydra.searchpath'"),
    (["train", "-m", "seed=0,1", "hydra/callbacks=mine"], "no option 'hydra/callbacks'"),
    (["train", "hydra.launcher.n_job=2"], "did you mean hydra.launcher.n_jobs"),
    (["evaluate", "hydra.run.dir=x"], "no option 'hydra.run.dir'"),
    # sweeps
    (["train", "-m", "experiment=glob(*)"], "write the values one by one"),
    (["train", "-m", "seed=0,x"], "seed=x"),
    (["train", "-m", "experiment=ib,noib"], "did you mean no_ib"),
    (["train", "-m", "ppo.grasps=4,0"], "ppo.grasps=0"),
    (["train", "-m", "ppo.hidden=4,0"], "ppo.hidden=0"),
    (["train", "-m", "seed=range(0,3)", "ppo.grasps=0"], "ppo.grasps=0"),
    (["train", "-m", "seed=0,1", "grasp.deformation_m=0.02"], "eq. 3"),
    (["train", "--multirun", "sead=1,2"], "did you mean seed"),
    (["train", "-m", "hydra/launcher=jobli"], "jobli"),
    (["train", "sweep=ablation"], "add -m"),
    (["train", "sweep=ablatoin"], "did you mean ablation"),
    (["train", "-m", "sweep=ablation,parts"], "one preset at a time"),
    (["train", "-m", "sweep=ablation", "ppo.grasps=0"], "ppo.grasps=0"),
    (["train", "-m", "sweep=ablation", "experiment=ib,no_id"], "did you mean no_ib"),
    (["train", "-m", "sweep=ablation", "hydra.sweep.dir="], "hydra.sweep.dir"),
    # learning curves
    (["curves"], "forcegrasp curves runs/SWEEP"),
    (["curves", "nowhere"], "nowhere: no such folder"),
    (["curves", "file"], "file: no such folder"),
    (["curves", "empty"], "empty: no run in it"),
    (["curves", "finished", "empty"], "empty: no run in it"),
    (["curves", "folder=finished"], "did you mean folders"),
    (["curves", "finished", "folders=range(1,3)"], "folders are a list"),
    (["curves", "silent"], "no run in it has finished a batch yet"),
    (["curves", "headless"], "no run in it has finished a batch yet"),
    (["curves", "broken"], "broken/config.yaml: not a valid configuration"),
    (["curves", "binary"], "binary/metrics.csv: can't be read"),
    (["curves", "foreign"], "no column 'episode/force_reward_normalised'"),
    (["curves", "garbled"], "line 2: episode/force_reward_paper is 'much', not a number"),
    (["curves", "short"], "line 2: episode/displacement_until_grasped_mm is nothing, not a number"),
    (["curves", "repeated"], "line 3: frames do not grow"),
    (["curves", "finished", "out=file"], "could not write"),
    # videos
    (["render", "policy=force_p"], "did you mean force_pi"),
    (["render", "policy="], "a name is empty"),
    (["render", "policy=runs/nowhere"], "no such run directory"),
    (["render", "policy=damaged"], "damaged"),
    (["render", "policies=[]"], "must not be empty"),
    (["render", "policy=force_pi", "policy=close"], "policies=[A,B]"),
    (["render", "policy=force_pi", "policies=[close]"], "policies=[A,B]"),
    (["render", "kapa=0.5"], "did you mean kappa"),
    (["render", "kappa=2"], "kappa=2.0: must lie in [0, 1]"),
    (["render", "kappa=soft"], "kappa"),
    (["render", "radius_m=0.1"], "tiago opens so wide that it takes radii below 0.045 m"),
    (["render", "radius_m=nan"], "radius_m=nan: must lie in"),
    (["render", "radius_m=0.035", "offset_m=0.02"], "can be grasped up to ± 0.0100 m off the middle"),
    (["render", "offset_m=0.03"], "no object can be grasped beyond ± 0.0165 m"),
    (["render", "goal_force_n=1", "kappa=1"], "the gripper reaches 0.142 N"),
    (["render", "model=nowhere.yaml"], "nowhere.yaml"),
    (["render", "model=file"], "file"),
    (["render", "model=file", "b2=-9"], "the model brings its own"),
    (["render", "out=grasp.avi"], "videos are GIF or MP4; name a file that ends with .gif or .mp4"),
    (["render", "out=grasp"], ".gif"),
    (["render", "live=true", "physics=warp"], "live=true: the viewer shows engine mujoco alone"),
    (["render", "-m", "seed=0,1"], "key=value"),
    # runs and files
    (["train", "resume=nowhere"], "nowhere: no such run directory"),
    (["train", "resume="], "resume"),
    (["train", "resume=empty"], "not a run directory"),
    (["train", "resume=file"], "file"),
    (["train", "resume=finished", "seed=3"], "drop seed=3"),
    (
        ["train", "resume=finished", "-m"],
        "finished: no sweep is there (no multirun.yaml); a single run is resumed without -m",
    ),
    (["train", "resume=nowhere", "-m"], "nowhere: no sweep is there"),
    (["train", "resume=a_sweep"], "go on with it by forcegrasp train -m resume=a_sweep"),
    (["train", "resume=odd_sweep", "-m"], "odd_sweep/multirun.yaml: not what a sweep leaves there"),
    (["train", "resume=finished", "resume=finished"], "resume="),
    (["train", "resume=other"], "another configuration"),
    (["train", "resume=broken"], "config.yaml: not a valid configuration"),
    (["train", "resume=damaged"], "damaged"),
    (["train", "hydra.run.dir=finished"], "already holds a run; continue it with resume=finished"),
    (
        ["train", "seed=3", "hydra.run.dir=started"],
        "already holds a run with another seed; continue it with resume=started",
    ),
    (["train", "hydra.run.dir=file/run"], "could not make the run directory"),
    (["train", "hydra.run.dir=file"], "could not make the run directory"),
    (["evaluate", "policies=[]"], "must not be empty"),
    (["evaluate", "policies=[ibb]"], "did you mean ib"),
    (["evaluate", "plan=papr"], "did you mean paper"),
    (["evaluate", "plan=paper,objects"], "several values"),
    (["evaluate", "objects=nowhere.yaml"], "nowhere.yaml: not readable"),
    (["evaluate", "model=virtual_robott"], "virtual_robott"),
    (["train", "plan=paper"], "no option 'plan'"),
    (["train", "reward.forces=true"], "must be one of actual, measured"),
    (["record", "plan=paper"], "must be one of rich"),
    (["evaluate", "policies="], "policies"),
    (["evaluate", "policies=['']"], "polic"),
    (["evaluate", "policies=[force_p]"], "did you mean force_pi"),
    (["evaluate", "policies=[runs/nowhere]"], "no such run directory"),
    (["evaluate", "policies=[empty]"], "not a run directory"),
    (["evaluate", "policies=[force_pi,force_pi]"], "twice"),
    (["evaluate", "policies=[finished,./finished/]"], "twice"),
    (["evaluate", "policies=force_pi,close"], "policies"),
    (["evaluate", "policy=ibb"], "did you mean ib"),
    (["evaluate", "policies=force_p"], "did you mean force_pi"),
    (["evaluate", "policy=close", "policies=[force_pi]"], "policies=[A,B]"),
    (["evaluate", "policies=runs/seed=0"], "runs/seed=0: no such run directory"),
    (["evaluate", "policies=[force_pi"], "policies"),
    (["evaluate", "policies=[other]"], "another configuration"),
    (["evaluate", "policies=[damaged]"], "damaged"),
    (["evaluate", "policies=[started]"], "no checkpoint yet; train it with: forcegrasp train resume=started"),
    (["evaluate", "out=file"], "could not write"),
    (["evaluate", "out=file/below"], "could not write"),
    (["export"], "which run?"),
    (["export", ""], "which run?"),
    (["export", "run="], "which run?"),
    (["export", "nowhere"], "nowhere"),
    (["export", "run=nowhere"], "nowhere"),
    (["export", "empty"], "not a run directory"),
    (["export", "file"], "file"),
    (["export", "other"], "another configuration"),
    (["export", "damaged"], "damaged"),
    (["export", "started"], "no checkpoint yet"),
    (["export", "finished", "started"], "one run at a time"),
    (["export", "finished", "run=finished"], "one run at a time"),
    (["export", "finished", "out=file"], "could not write"),
    (["export", "finished", "out=finished"], "is not empty"),
    (["export", "finished", "ceiling_n=0"], "ceiling_n=0"),
    (["export", "finished", "ceiling_n=nan"], "ceiling_n=nan"),
    (["export", "finished", "celing_n=1"], "did you mean ceiling_n"),
    (["export", "finished", "seed=1"], "no option 'seed'"),
]


@pytest.fixture(scope="module")
def runs(tmp_path_factory, finished) -> Path:
    """A folder with runs that are in order, and some that are not."""
    folder = tmp_path_factory.mktemp("runs")
    (folder / "empty").mkdir()
    (folder / "file").write_text("text")
    for name in ("finished", "other", "broken", "damaged", "started"):
        shutil.copytree(finished, folder / name)
    config = (folder / "other" / "config.yaml").read_text()
    (folder / "other" / "config.yaml").write_text(config.replace("seed: 0", "seed: 1"))
    (folder / "broken" / "config.yaml").write_text("ppo: [")
    for name, record in (("a_sweep", "hydra: {overrides: {task: [], hydra: []}}"), ("odd_sweep", "hydra: 3")):
        (folder / name).mkdir()
        (folder / name / "multirun.yaml").write_text(record)
    for path in (folder / "damaged" / "checkpoints").iterdir():
        path.write_bytes(path.read_bytes()[:-1] + b"\x01")
    for path in (folder / "started" / "checkpoints").iterdir():
        path.unlink()
    header, row = (finished / "metrics.csv").read_text().splitlines()
    values = dict(zip(header.split(","), row.split(","), strict=True))
    for name, text in {
        "headless": header,
        "binary": b"\xff\xfe\x00",
        "foreign": "frames,loss\n8,1.0\n",
        "garbled": f"{header}\n{','.join((values | {'episode/force_reward_paper': 'much'}).values())}\n",
        "short": f"{header}\n8,1,2,3,4\n",
        "repeated": f"{header}\n{row}\n{row}\n",
    }.items():
        shutil.copytree(finished, folder / name)
        (folder / name / "metrics.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    shutil.copytree(finished, folder / "silent")
    (folder / "silent" / "metrics.csv").unlink()
    return folder


@pytest.fixture
def folder(runs, monkeypatch) -> Path:
    """The working directory of those who write nothing, as these tests find."""
    monkeypatch.chdir(runs)
    return runs


@pytest.fixture
def copied(runs, tmp_path, monkeypatch) -> Path:
    """The working directory of those who do."""
    monkeypatch.chdir(shutil.copytree(runs, tmp_path / "runs"))
    return tmp_path / "runs"


def contents(folder: Path) -> dict[Path, bytes | None]:
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.mark.parametrize(("arguments", "told"), MISTAKES, ids=[" ".join(arguments) for arguments, _ in MISTAKES])
def test_mistake(arguments, told, folder, tiny, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", sys.argv)  # Hydra's sweeps read and change both
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    verb, *rest = arguments
    resuming = any("resume=" in argument for argument in rest)
    before = contents(folder)
    status = main([verb, *([] if resuming else tiny.get(verb, [])), *rest])
    out, err = capsys.readouterr()
    assert status == 2
    assert err.startswith("forcegrasp: ")
    assert err.count("\n") == 1
    assert err.endswith("\n")
    assert not out
    assert told in err
    assert "Traceback" not in err
    assert "<class" not in err
    assert contents(folder) == before


@pytest.mark.parametrize(
    ("arguments", "told"),
    [(["trian"], "train"), (["train", "ppo.grasps=0"], "ppo.grasps")],
)
def test_mistake_in_a_process_of_its_own(arguments, told, tmp_path):
    command = [sys.executable, "-m", "forcegrasp.cli.main", *arguments]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert re.fullmatch(r"forcegrasp: .+\n", done.stderr)
    assert told in done.stderr
    assert not done.stdout
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("again", [["resume=started"], ["hydra.run.dir=started"]])
@pytest.mark.usefixtures("copied")
def test_a_run_without_a_checkpoint_can_be_begun_again_either_way(again, tiny):
    finished = Path("finished/checkpoints")
    assert main(["train", *again, *([] if "resume" in again[0] else tiny["train"])]) == 0
    for path in finished.iterdir():
        assert Path("started/checkpoints", path.name).read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "lock"),
    [
        (["resume=started"], "started/lock"),
        (["hydra.run.dir=started"], "started/lock"),
        (["-m", "seed=0,1", "hydra.sweep.dir=sweep"], "sweep/sweep.lock"),
    ],
)
def test_what_another_training_is_writing(arguments, lock, copied, tiny, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", sys.argv)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    with only_writer(Path(lock)):
        before = contents(copied)
        assert main(["train", *arguments, *([] if "resume" in arguments[0] else tiny["train"])]) == 2
        assert contents(copied) == before
    out, err = capsys.readouterr()
    assert not out
    told = f"process {os.getpid()} on {platform.node()} is training here; wait until it has ended, or end it"
    assert err == f"forcegrasp: {Path(lock).parent}: {told}\n"


@pytest.mark.parametrize("sweep", [[], ["-m", "seed=0,1"]])
def test_ray_is_not_installed(sweep, folder, tiny, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    before = contents(folder)
    assert main(["train", *sweep, *tiny["train"], "collector=ray"]) == 2
    assert capsys.readouterr() == ("", "forcegrasp: collector.kind=ray needs an extra: pip install 'forcegrasp[ray]'\n")
    assert contents(folder) == before


def test_launcher_is_not_installed(folder, capsys, monkeypatch):
    monkeypatch.setattr("forcegrasp.cli.sweep.find_spec", lambda name: None)
    before = contents(folder)
    assert main(["train", "-m", "seed=0,1", "hydra/launcher=submitit_slurm"]) == 2
    assert capsys.readouterr().err == (
        "forcegrasp: hydra/launcher=submitit_slurm needs an extra: pip install 'forcegrasp[cluster]'\n"
    )
    assert contents(folder) == before


def test_full_disk_while_training(tiny, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def no_space(*args):
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(os, "fsync", no_space)
    assert main(["train", *tiny["train"], "hydra.run.dir=full"]) == 2
    err = capsys.readouterr().err
    assert re.fullmatch(r"forcegrasp: .*full.*No space left on device.*\n", err)


def test_setting_of_mujocos_renderer_does_not_matter(tmp_path):
    """A recording starts sooner than a training, of which test_terminal.py says so, and imports MuJoCo alike."""
    command = [sys.executable, "-m", "forcegrasp", "record", "grasps=1", "objects=1", "out=run"]
    environment = {**os.environ, "MUJOCO_GL": "osmesa"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not done.stderr
