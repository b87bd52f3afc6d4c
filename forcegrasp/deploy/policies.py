"""What decides: the exported network and the hand-written controller, from one observation to one action."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np

from forcegrasp.deploy.contract import FINGERS, INPUT, NETWORK_FILE, OUTPUT, Contract, read_contract
from forcegrasp.errors import DeployError


class Policy(Protocol):
    """Whatever a controller may ask what to do."""

    def reset(self) -> None:
        """Forgets: a new grasp begins."""
        ...

    def act(self, parts: dict[str, np.ndarray]) -> np.ndarray:
        """The action (left, right), ``(2,)``, −1 closing at full speed; from every part of o(t), float32 ``(2,)``."""
        ...


class OnnxPolicy:
    """An exported network, and the stack of observations that it sees.

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
        expected = [(INPUT, "tensor(float)", [1, contract.observation_size]), (OUTPUT, "tensor(float)", [1, FINGERS])]
        if found != expected:
            raise DeployError(f"{NETWORK_FILE}: has {found}, but its contract says {expected}")
        self._session, self._parts, self._frames = session, contract.parts, contract.frames
        self.reset()

    @classmethod
    def load(cls, folder: Path | str) -> tuple[OnnxPolicy, Contract]:
        """Reads an exported folder.

        Raises:
          DeployError: if it is missing, damaged, or can't be run here.
        """
        contract, network = read_contract(folder)
        try:
            return cls(network, contract), contract
        except DeployError as error:
            raise DeployError(f"{folder}: {error}") from error

    def reset(self) -> None:
        """Forgets: the next observation fills the whole stack."""
        self._stack: np.ndarray | None = None

    def act(self, parts: dict[str, np.ndarray]) -> np.ndarray:
        """The mean of the policy's Gaussian, not clipped, float32 ``(2,)``."""
        frame = np.concatenate([parts[name] for name in self._parts])
        if self._stack is None:
            self._stack = np.tile(frame, self._frames)
        else:
            self._stack = np.concatenate([self._stack[len(frame) :], frame])
        return self._session.run([OUTPUT], {INPUT: self._stack[np.newaxis]})[0][0]


class ForcePI:
    """The grasp controller of Lach et al. (2022): the same law as ``forcegrasp.controllers.ForcePI``, in numpy.

    A finger that has not touched closes; one that has waits for the other; once both have, both get half of the PI
    law's position delta Δq = −½ Σ_i (K_p e_i + K_i I_i), e_i = Δf_i / k, with one integral for both fingers.

    Args:
      max_delta_m: Δq_max, metres.
      period_s: control period, seconds.
      stiffness: k, newtons per metre.
      kp, ki: K_p (1) and K_i (1/s).
      closing_m: position delta while closing, metres per step.
    """

    def __init__(
        self,
        max_delta_m: float,
        period_s: float,
        stiffness: float = 160.0,
        kp: float = 0.18,
        ki: float = 1.13,
        closing_m: float = 0.004,
    ) -> None:
        self.max_delta_m, self.period_s = max_delta_m, period_s
        self.stiffness, self.kp, self.ki, self.closing_m = stiffness, kp, ki, closing_m
        self.reset()

    def reset(self) -> None:
        """Forgets the integral."""
        self._integral = 0.0

    def act(self, parts: dict[str, np.ndarray]) -> np.ndarray:
        """The action, float64 ``(2,)``, not clipped."""
        touched = parts["had_contact"] > 0.5
        if not touched.all():
            return np.where(touched, 0.0, -self.closing_m) / self.max_delta_m
        error = parts["force_error"].astype(np.float64) / self.stiffness
        # the left error enters the integral, which is used, then the right one, and it is used again
        running = self._integral + np.cumsum(error * self.period_s)
        self._integral = float(running[-1])
        delta = -0.5 * np.sum(self.kp * error + self.ki * running)
        return np.full(FINGERS, delta / self.max_delta_m)
