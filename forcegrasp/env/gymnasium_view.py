"""One grasp of the paper's learning problem behind gymnasium's interface."""

from __future__ import annotations

from typing import Any, cast

import gymnasium
import numpy as np
import torch
from tensordict import TensorDictBase
from torchrl.envs.utils import step_mdp

from forcegrasp.env.build import build_env, seed_env
from forcegrasp.env.grasp_env import GraspEnv
from forcegrasp.errors import ConfigError
from forcegrasp.physics.scene_renderer import SceneRenderer

#: Pixels of a picture.
WIDTH, HEIGHT = 480, 360


class GraspGymnasiumEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """Observation: the stacked o(t), ``(30,)`` by default. Action: ``(motors,)`` in [−1, 1], scaled to position deltas.

    ``info`` holds the true state of the grasp (see ``forcegrasp.env.grasp_env.OBSERVATIONS``;
    nested names are joined by a dot).

    Args:
      seed: seed until :meth:`reset` is given one.
      render_mode: "rgb_array" for pictures from :meth:`render`; none by default.
      **parts: configuration of :func:`~forcegrasp.env.build_env`.

    Raises:
      ConfigError: if there is no such render mode, or a part is out of its range.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 25}  # noqa: RUF012

    def __init__(self, seed: int = 0, render_mode: str | None = None, **parts: Any) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ConfigError(f"render_mode={render_mode}: must be rgb_array, or left out")
        self.render_mode = render_mode
        self._env = build_env(1, seed=seed, **parts)
        gripper = cast(GraspEnv, self._env.base_env).gripper
        self._renderer = SceneRenderer(WIDTH, HEIGHT, gripper)
        self._motors = len(gripper.motors)
        self._state: TensorDictBase | None = None
        size = self._env.observation_spec["observation"].shape[-1]
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (self._motors,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        """Starts a new grasp."""
        super().reset(seed=seed)
        if seed is not None:
            seed_env(self._env, seed)
        self._state = self._env.reset()
        return self._observe(self._state)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        """One control step."""
        if self._state is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        self._state.set("action", torch.as_tensor(action, dtype=torch.float32).reshape(1, self._motors))
        stepped = self._env.step(self._state)
        after = stepped.get("next")
        observation, info = self._observe(after)
        self._state = step_mdp(stepped)
        return observation, float(after["reward"]), bool(after["terminated"]), bool(after["truncated"]), info

    def render(self) -> np.ndarray | None:
        """The scene as it stands, uint8 ``(360, 480, 3)``; None without a render mode.

        Raises:
          NoRendererError: where there is no OpenGL.
        """
        if self.render_mode is None:
            gymnasium.logger.warn('render() shows nothing: make the environment with render_mode="rgb_array"')
            return None
        if self._state is None:
            raise gymnasium.error.ResetNeeded("call reset() before render()")
        parameters, fingers, offset = (
            self._state.get(key)[0].double().numpy()
            for key in ("grasp_parameters", "joint_position", "object_position")
        )
        return self._renderer.draw(parameters, fingers, float(offset[0]))

    def close(self) -> None:
        """Ends the process that draws."""
        self._renderer.close()

    def _observe(self, state: TensorDictBase) -> tuple[np.ndarray, dict]:
        info = {key: value[0].numpy().copy() for key, value in state.flatten_keys(".").items()}
        return info.pop("observation"), info
