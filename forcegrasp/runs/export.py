"""Turns a policy into a folder that runs without torch; what runs it is ``forcegrasp.deploy``."""

from __future__ import annotations

import dataclasses
import logging
import math
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from forcegrasp.assets import DEFAULT_GRIPPER
from forcegrasp.config import ActionConfig, TrainConfig
from forcegrasp.controllers import ForcePI
from forcegrasp.controllers.policy import network_of
from forcegrasp.controllers.recurrent import RecurrentNetwork
from forcegrasp.deploy import Contract, ForcePIGains, GraspController, GripperInterface, OnnxPolicy
from forcegrasp.deploy.contract_file import FORCE_PI, INPUT, MEMORY, NETWORK_FILE, NEXT_MEMORY, OUTPUT, write_contract
from forcegrasp.errors import ConfigError, DeployError
from forcegrasp.physics import Gripper, load_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.physics.gripper import NO_FORCES
from forcegrasp.runs.config_file import fingerprint
from forcegrasp.runs.policy import load_policy

#: The operator set that torch's exporter works in; any other would be converted.
OPSET = 18
#: Largest difference between torch and onnxruntime that passes; float32 keeps seven digits.
TOLERANCE = 1e-5
CHECKS = 1000
# Readings that can't be true: by so many strokes beyond both ends; and forces, as multiples of the gripper's ceiling.
_BEYOND_STROKE, _FORCES = 2 / 45, (-0.5, 10.0)
# Shortest and longest time between two readings, control periods.
_GAP = (0.5, 2.5)


@dataclass(frozen=True)
class Exported:
    """What an export came to."""

    contract: Contract
    difference: float | None  #: largest |action in onnxruntime − action in torch|; None where no network decides
    step_us: float  #: median time of a controller's step on this machine, microseconds


def export_policy(name: str | Path, out: str | Path, ceiling_n: float | None = None, gripper: str = "") -> Exported:
    """Writes ``policy.onnx`` and ``contract.json``, and tries them out.

    Args:
      name: a run directory, the name of a shipped policy, or ``force_pi``, which needs no network.
      out: the folder to write; must not exist, or be empty.
      ceiling_n: force above which no motor may close further, newtons; the gripper's if None.
      gripper: of ``force_pi``, by name or the path of its description; the paper's if empty.

    Raises:
      CheckpointError: if there is no such policy.
      ConfigError: if there is no such gripper, it reads no forces, or it is asked for beside a run.
      DeployError: if packages are missing, the folder holds something, the ceiling is below every goal that was
        trained, or the exported network acts differently.
      OSError: if the folder can't be written.
    """
    out = Path(out)
    torch.set_num_threads(1)  # the network is far too small for more
    if out.is_dir() and any(out.iterdir()):
        raise DeployError(f"out={out}: is not empty; name a new folder")
    if str(name) == FORCE_PI:
        return _export_force_pi(gripper or DEFAULT_GRIPPER, out, ceiling_n)
    policy, config = load_policy(name)
    if gripper:
        raise ConfigError(f"gripper={gripper}: {name} was trained on {config.gripper}; leave gripper= out")
    contract = _named(name, config, ceiling_n)
    mean = network_of(policy)  # of the Gaussian; its deviation is for training
    if isinstance(mean, RecurrentNetwork):
        contract = dataclasses.replace(contract, memory=mean.size)
    network, versions = to_onnx(mean, contract)
    difference = largest_difference(mean, OnnxPolicy(network, contract), contract)
    if not difference <= TOLERANCE:
        raise DeployError(f"{name}: the exported network acts differently ({difference:.1g}); train the policy anew")
    source = {"policy": Path(name).resolve().name, "config": fingerprint(dataclasses.asdict(config))}
    source |= {"opset": OPSET, "versions": versions}
    out.mkdir(parents=True, exist_ok=True)
    (out / NETWORK_FILE).write_bytes(network)
    write_contract(out, contract, network, source)  # last: a folder without it can't be loaded
    return Exported(contract, difference, median_step_us(GraspController.load(out)))


def _export_force_pi(gripper: str, out: Path, ceiling_n: float | None) -> Exported:
    contract = _named(FORCE_PI, TrainConfig(gripper=gripper, action=ActionConfig(inductive_bias=False)), ceiling_n)
    law = ForcePI(load_gripper(gripper))
    out.mkdir(parents=True, exist_ok=True)
    write_contract(out, contract, ForcePIGains(law.stiffness, law.kp, law.ki, law.closing_step), {"policy": FORCE_PI})
    return Exported(contract, None, median_step_us(GraspController.load(out)))


def _named(name: Path | str, config: TrainConfig, ceiling_n: float | None) -> Contract:
    """The contract, or a DeployError that names the policy."""
    try:
        return contract_of(config, ceiling_n)
    except ValueError as error:
        raise DeployError(f"{name}: {error}") from error


def contract_of(config: TrainConfig, ceiling_n: float | None = None) -> Contract:
    """The contract of a training: goals are those that it could draw.

    Raises:
      ConfigError: if the gripper reads no forces.
      ValueError: if the ceiling is below every goal, or above what a sensor can read.
    """
    gripper = load_gripper(config.gripper)
    if not gripper.forces:
        raise ConfigError(f"gripper={gripper.name}: {NO_FORCES}")
    config, training = complete(config, gripper), gripper.training
    grasp, action, ceiling = config.grasp, config.action, training.ceiling_n
    # an effort has the sign of the motion; a finger's sensor is pressed, or off by some offset
    lowest, highest = (factor * ceiling for factor in _FORCES)
    beyond = _BEYOND_STROKE * gripper.stroke
    reached = grasp.goal_force_max * training.max_force_n * np.asarray(training.force_scale(np.array(grasp.kappa)))
    return Contract(
        gripper=interface_of(gripper),
        parts=tuple(config.observation.parts),
        frames=config.observation.frames,
        position_scale_per_m=2 / gripper.stroke,
        position_offset=-1.0,
        contact_threshold_n=config.sensors.contact_threshold_n,
        stall=gripper.stall if math.isfinite(gripper.stall) else None,
        inductive_bias=action.inductive_bias,
        bias_one_contact=action.bias_one_contact,
        bias_floor=action.bias_floor,
        max_delta_m=action.max_delta_m,
        joint_range_m=(0.0, gripper.stroke),
        goal_range_n=(float(min(grasp.goal_force_min_n, reached.min())), float(reached.max())),
        control_period_s=gripper.period_s,
        ceiling_n=ceiling if ceiling_n is None else ceiling_n,
        position_reading_m=(-beyond, gripper.stroke + beyond),
        force_reading_n=(-highest if gripper.force == "motor" else lowest, highest),
        gentle_n=action.gentle_touch * training.largest_force_n,
        gap_s=(_GAP[0] * gripper.period_s, _GAP[1] * gripper.period_s),
    )


def interface_of(gripper: Gripper) -> GripperInterface:
    """What is read of a gripper."""
    positions, forces = (tuple(c.column for c in channels) for channels in (gripper.positions, gripper.forces))
    return GripperInterface(gripper.name, gripper.unit, positions, forces)


def to_onnx(network: nn.Module, contract: Contract) -> tuple[bytes, dict[str, str]]:
    """A network of one observation, and of the memory if it has one, as ONNX, and the versions of what made it.

    Raises:
      DeployError: if the packages for it are missing.
    """
    try:
        import onnx  # noqa: F401  (torch needs these two)
        import onnxruntime  # noqa: F401  (the result is tried out)
        import onnxscript  # noqa: F401
    except ImportError as error:
        raise DeployError("exporting a policy needs an extra: pip install 'forcegrasp[onnx]'") from error
    remembers = contract.memory > 0
    with _quiet():
        program = torch.onnx.export(
            network.eval(),
            (torch.zeros(1, contract.observation_size), *[torch.zeros(1, contract.memory)] * remembers),
            input_names=[INPUT, *[MEMORY] * remembers],
            output_names=[OUTPUT, *[NEXT_MEMORY] * remembers],
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
        )
    assert program is not None  # with dynamo
    model = program.model_proto
    graph = model.graph
    for entry in (*graph.node, *graph.value_info, *graph.input, *graph.output, *graph.initializer, graph, model):
        del entry.metadata_props[:]  # where in whose source code each node comes from
    names = ("forcegrasp", "torch", "onnx", "onnxscript")
    return model.SerializeToString(deterministic=True), {package: version(package) for package in names}


def largest_difference(mean: nn.Module, exported: OnnxPolicy, contract: Contract) -> float:
    """The largest difference in action over random observations, one grasp's; NaN if one is not finite."""
    ends = np.cumsum([len(contract.columns(part)) for part in contract.parts])
    values = np.random.default_rng(0).normal(scale=2.0, size=(CHECKS, int(ends[-1]))).astype(np.float32)
    exported.reset()
    frames = [dict(zip(contract.parts, np.split(frame, ends[:-1]), strict=True)) for frame in values]
    actual = np.stack([exported.act(frame) for frame in frames])
    first = contract.frames - 1
    padded = np.concatenate([values[:1]] * first + [values])
    stacked = np.concatenate([padded[k : k + CHECKS] for k in range(contract.frames)], axis=1)
    with torch.no_grad():
        expected = _actions(mean, torch.from_numpy(stacked)).numpy()
    return float(np.abs(actual - expected).max())  # which passes a NaN on


def _actions(mean: nn.Module, observations: Tensor) -> Tensor:
    """What torch does with the observations of one grasp, ``(T, n) -> (T, motors)``."""
    if not isinstance(mean, RecurrentNetwork):
        return mean(observations)
    memory, actions = torch.zeros(1, mean.size), []
    for observation in observations.split(1):
        action, memory = mean(observation, memory)
        actions.append(action)
    return torch.cat(actions)


def median_step_us(controller: GraspController) -> float:
    """Median time of a step over 1,000 plausible readings, microseconds."""
    rng = np.random.default_rng(0)
    contract, times = controller.contract, []
    controller.reset(min(contract.goal_range_n[0], contract.ceiling_n))
    for step in range(CHECKS):
        q = rng.uniform(*contract.joint_range_m, len(contract.gripper.positions))
        f = rng.uniform(0, min(contract.goal_range_n), len(contract.gripper.forces))
        start = time.perf_counter()
        controller.step(q, f, step * contract.control_period_s)
        times.append(time.perf_counter() - start)
    return float(np.median(times)) * 1e6


@contextmanager
def _quiet() -> Iterator[None]:
    """Silences torch's exporter, which warns of its own ways and of packages that it could also export."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)
