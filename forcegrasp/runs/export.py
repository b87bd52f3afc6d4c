"""Turns a trained policy into a folder that runs without torch; what runs it is ``forcegrasp.deploy``."""

from __future__ import annotations

import dataclasses
import logging
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import cast

import numpy as np
import torch
from torch import nn

from forcegrasp.config import TrainConfig
from forcegrasp.deploy import Contract, GraspController, OnnxPolicy
from forcegrasp.deploy.contract import INPUT, NETWORK_FILE, OUTPUT, write_contract
from forcegrasp.errors import DeployError
from forcegrasp.physics.model import CONTROL_PERIOD_S
from forcegrasp.physics.parameters import MAX_FORCE_N, force_scale_of_kappa
from forcegrasp.physics.sampling import OPEN_M
from forcegrasp.runs.policy import load_policy
from forcegrasp.runs.run_dir import fingerprint

#: The operator set that torch's exporter works in; any other would be converted.
OPSET = 18
#: Largest difference between torch and onnxruntime that passes; float32 keeps seven digits.
TOLERANCE = 1e-5
CHECKS = 1000


@dataclass(frozen=True)
class Exported:
    """What an export came to."""

    contract: Contract
    difference: float  #: largest |action in onnxruntime − action in torch| over random observations
    step_us: float  #: median time of a controller's step on this machine, microseconds


def export_policy(name: str | Path, out: str | Path, ceiling_n: float) -> Exported:
    """Writes ``policy.onnx`` and ``contract.json``, and tries them out.

    Args:
      name: a run directory, or the name of a shipped policy.
      out: the folder to write; must not exist, or be empty.
      ceiling_n: force above which a finger may not be closed further, newtons.

    Raises:
      CheckpointError: if there is no such policy.
      DeployError: if packages are missing, the folder holds something, the ceiling is below every goal that was
        trained, or the exported network acts differently.
      OSError: if the folder can't be written.
    """
    out = Path(out)
    torch.set_num_threads(1)  # the network is far too small for more
    policy, config = load_policy(name)
    if out.is_dir() and any(out.iterdir()):
        raise DeployError(f"out={out}: is not empty; name a new folder")
    try:
        contract = contract_of(config, ceiling_n)
    except ValueError as error:
        raise DeployError(f"{name}: {error}") from error
    mean = cast(nn.Sequential, policy[0].module)[0]  # of the Gaussian; its deviation is for training
    network, versions = to_onnx(mean, contract.observation_size)
    difference = largest_difference(mean, OnnxPolicy(network, contract), contract)
    if not difference <= TOLERANCE:
        raise DeployError(f"{name}: the exported network acts differently ({difference:.1g}); train the policy anew")
    source = {"policy": Path(name).resolve().name, "config": fingerprint(dataclasses.asdict(config))}
    source |= {"opset": OPSET, "versions": versions}
    out.mkdir(parents=True, exist_ok=True)
    (out / NETWORK_FILE).write_bytes(network)
    write_contract(out, contract, network, source)  # last: a folder without it can't be loaded
    return Exported(contract, difference, median_step_us(GraspController.load(out)))


def contract_of(config: TrainConfig, ceiling_n: float) -> Contract:
    """The contract of a training: goals are those that it could draw."""
    grasp, action = config.grasp, config.action
    hardest, softest = grasp.goal_force_max * MAX_FORCE_N * force_scale_of_kappa(np.array(grasp.kappa))
    return Contract(
        parts=tuple(config.observation.parts),
        frames=config.observation.frames,
        position_scale_per_m=2 / OPEN_M,
        position_offset=-1.0,
        contact_threshold_n=config.sensors.contact_threshold_n,
        inductive_bias=action.inductive_bias,
        bias_one_contact=action.bias_one_contact,
        bias_floor=action.bias_floor,
        max_delta_m=action.max_delta_m,
        joint_range_m=(0.0, OPEN_M),
        goal_range_n=(float(min(grasp.goal_force_min_n, softest)), float(hardest)),
        control_period_s=CONTROL_PERIOD_S,
        ceiling_n=ceiling_n,
    )


def to_onnx(network: nn.Module, size: int) -> tuple[bytes, dict[str, str]]:
    """A network of ``(1, size)`` as ONNX, and the versions of what made it.

    Raises:
      DeployError: if the packages for it are missing.
    """
    try:
        import onnx  # noqa: F401  (torch needs these two)
        import onnxruntime  # noqa: F401  (the result is tried out)
        import onnxscript  # noqa: F401
    except ImportError as error:
        raise DeployError("exporting a policy needs an extra: pip install 'forcegrasp[onnx]'") from error
    with _quiet():
        program = torch.onnx.export(
            network.eval(),
            (torch.zeros(1, size),),
            input_names=[INPUT],
            output_names=[OUTPUT],
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
    """The largest difference in action over random observations; NaN if one is not finite."""
    values = np.random.default_rng(0).normal(scale=2.0, size=(CHECKS, len(contract.parts), 2)).astype(np.float32)
    exported.reset()
    actual = np.stack([exported.act(dict(zip(contract.parts, parts, strict=True))) for parts in values])
    first = contract.frames - 1
    padded = np.concatenate([values[:1]] * first + [values]).reshape(CHECKS + first, -1)
    stacked = np.concatenate([padded[k : k + CHECKS] for k in range(contract.frames)], axis=1)
    with torch.no_grad():
        expected = mean(torch.from_numpy(stacked)).numpy()
    return float(np.abs(actual - expected).max())  # which passes a NaN on


def median_step_us(controller: GraspController) -> float:
    """Median time of a step over 1,000 plausible readings, microseconds."""
    rng = np.random.default_rng(0)
    contract, times = controller.contract, []
    controller.reset(min(contract.goal_range_n[0], contract.ceiling_n))
    for step in range(CHECKS):
        q, f = rng.uniform(*contract.joint_range_m, 2), rng.uniform(0, min(contract.goal_range_n), 2)
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
