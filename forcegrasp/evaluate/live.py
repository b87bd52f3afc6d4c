"""A grasp in MuJoCo's viewer while it is simulated."""

from __future__ import annotations

import time
import warnings
from typing import Any, cast

import mujoco
from tensordict import TensorDictBase
from torchrl.envs import TransformedEnv

from forcegrasp.env import GraspEnv
from forcegrasp.errors import ConfigError
from forcegrasp.physics import GraspSimulator


class LiveView:
    """Shows every control step of a single grasp at the gripper's own pace; a callback of ``env.rollout``.

    On leaving it the last picture stays until the window is closed.

    Args:
      period_s: seconds per control step.

    Raises:
      ConfigError: where there is no display.
    """

    def __init__(self, period_s: float) -> None:
        from mujoco import viewer  # looks for a display

        self._library, self._period_s = viewer, period_s
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            if not cast(Any, viewer).glfw.init():  # the viewer's own thread would never come back
                why = str(told[0].message) if told else "GLFW does not start"
                raise ConfigError(f"live=true: no display here ({why}); write a video instead: out=NAME.gif")
        self._viewer: Any = None

    def __call__(self, env: TransformedEnv, state: TensorDictBase) -> None:
        """Shows where everything stands now."""
        simulator = cast(GraspSimulator, cast(GraspEnv, env.base_env).simulator)
        viewer = self._viewer = self._viewer or self._open(simulator)
        now = simulator.plant.batch.get_data(0)
        with viewer.lock():
            self._data.qpos[:], self._data.qvel[:], self._data.ctrl[:] = now.qpos, now.qvel, now.ctrl
            mujoco.mj_forward(self._model, self._data)
        viewer.sync()
        self._due = max(self._due + self._period_s, time.monotonic())
        time.sleep(max(0.0, self._due - time.monotonic()))

    def __enter__(self) -> LiveView:
        return self

    def __exit__(self, *error: object) -> None:
        while self._viewer is not None and self._viewer.is_running() and error[0] is None:
            time.sleep(0.1)
        if self._viewer is not None:
            self._viewer.close()

    def _open(self, simulator: GraspSimulator) -> Any:
        self._model, self._data = simulator.scene(0)
        self._due = time.monotonic()
        try:
            return self._library.launch_passive(self._model, self._data, show_left_ui=False, show_right_ui=False)
        except RuntimeError as error:  # macOS wants another interpreter
            raise ConfigError(f"live=true: {error}") from error
