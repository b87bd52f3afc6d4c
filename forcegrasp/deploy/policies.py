"""What decides: the exported network and the hand-written controller, from one observation to one action."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from forcegrasp.deploy.contract import Contract, ForcePIGains
from forcegrasp.deploy.contract_file import INPUT, MEMORY, NETWORK_FILE, NEXT_MEMORY, OUTPUT, read_contract
from forcegrasp.errors import DeployError


class Policy(Protocol):
    """Whatever a controller may ask what to do."""

    def reset(self) -> None:
        """Forgets: a new grasp begins."""
        ...

    def act(self, parts: dict[str, np.ndarray]) -> np.ndarray:
        """The action ``(motors,)``, −1 closing at full speed; from the parts of o(t), float32."""
        ...


class OnnxPolicy:
    """An exported network, the stack of observations that it sees, and what it remembers.

    Args:
      network: the bytes of ``policy.onnx``.
      contract: which parts it sees, and how many frames of them.

    Raises:
      DeployError: if onnxruntime is missing, or the network is not what the contract says.
    """

    def __init__(self, network: bytes, contract: Contract) -> None:
        try:
            import onnxruntime
        except ImportError as error:
            raise DeployError("running an exported policy needs onnxruntime: pip install onnxruntime") from error
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1  # more would only cost time
        try:
            session = onnxruntime.InferenceSession(network, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime's own, without a base of their own
            raise DeployError(f"{NETWORK_FILE}: onnxruntime can't load it; export the policy again") from error
        found = [(p.name, p.type, p.shape) for p in (*session.get_inputs(), *session.get_outputs())]
        memory = contract.memory
        inputs = {INPUT: contract.observation_size} | ({MEMORY: memory} if memory else {})
        outputs = {OUTPUT: contract.action_size} | ({NEXT_MEMORY: memory} if memory else {})
        sizes = (*inputs.items(), *outputs.items())
        expected = [(name, "tensor(float)", [1, size]) for name, size in sizes]
        if found != expected:
            raise DeployError(f"{NETWORK_FILE}: has {found}, but its contract says {expected}")
        self._session, self._parts, self._frames = session, contract.parts, contract.frames
        self._outputs, self._memory_size = list(outputs), memory
        self.reset()

    def reset(self) -> None:
        """Forgets: the next observation fills the whole stack, and the memory is zero."""
        self._stack: np.ndarray | None = None
        size = self._memory_size
        self._memory = {MEMORY: np.zeros((1, size), np.float32)} if size else {}

    def act(self, parts: dict[str, np.ndarray]) -> np.ndarray:
        """The mean of the policy's Gaussian, not clipped, float32 ``(motors,)``."""
        frame = np.concatenate([parts[name] for name in self._parts])
        if self._stack is None:
            self._stack = np.tile(frame, self._frames)
        else:
            self._stack = np.concatenate([self._stack[len(frame) :], frame])
        action, *after = self._session.run(self._outputs, {INPUT: self._stack[np.newaxis], **self._memory})
        if after and np.isfinite(after[0]).all():  # else all later actions would not be finite either
            self._memory = {MEMORY: after[0]}
        return action[0]


class ForcePI:
    """The grasp controller of Lach et al. (2022): the same law as ``forcegrasp.controllers.ForcePI``, in numpy.

    A finger that has not touched closes; one that has waits for the other; once all have, all motors get the PI law's
    position delta Δq = −(1/F) Σ_i (K_p e_i + K_i I_i), e_i = Δf_i / k, over F force readings, with one integral.
    Where readings and motors are not one to one, motors close until every reading has shown contact.

    Args:
      contract: gives Δq_max, the control period, and how many motors there are.
      gains: k, K_p, K_i and the step while closing.
    """

    def __init__(self, contract: Contract, gains: ForcePIGains) -> None:
        self.contract, self.gains = contract, gains
        self.reset()

    def reset(self) -> None:
        """Forgets the integral."""
        self._integral = 0.0

    def act(self, parts: dict[str, np.ndarray]) -> np.ndarray:
        """The action, float64 ``(motors,)``, not clipped."""
        contract, gains = self.contract, self.gains
        touched = parts["had_contact"] > 0.5
        if not touched.all():
            waits = touched if contract.gripper.one_to_one else np.zeros(contract.action_size, bool)
            return np.where(waits, 0.0, -gains.closing_step) / contract.max_delta_m
        error = parts["force_error"].astype(np.float64) / gains.stiffness
        # the left error enters the integral, which is used, then the right one, and it is used again
        running = self._integral + np.cumsum(error * contract.control_period_s)
        self._integral = float(running[-1])
        delta = -np.mean(gains.kp * error + gains.ki * running)
        return np.full(contract.action_size, delta / contract.max_delta_m)


def load_policy(folder: Path | str) -> tuple[Policy, Contract]:
    """Reads an exported folder.

    Raises:
      DeployError: if it is missing, damaged, or can't be run here.
    """
    contract, decides = read_contract(folder)
    if isinstance(decides, ForcePIGains):
        return ForcePI(contract, decides), contract
    try:
        return OnnxPolicy(decides, contract), contract
    except DeployError as error:
        raise DeployError(f"{folder}: {error}") from error
