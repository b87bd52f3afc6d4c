"""Pictures of a grasp, drawn in a process of their own: where there is no OpenGL, some drivers end who asks for it.

That process simulates nothing; it puts fingers and object where they were, whatever simulator or model moved them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import weakref
from typing import BinaryIO

import mujoco
import numpy as np

from forcegrasp.errors import ForcegraspError
from forcegrasp.physics.parameters import GraspParameters
from forcegrasp.physics.simulator import GraspSimulator

_BACKENDS = {"linux": ("egl", "osmesa"), "darwin": ("cgl",)}
#: What is asked for: grasp parameters, finger positions, object position.
_REQUEST = 5 + 2 + 1


class NoRendererError(ForcegraspError):
    """This machine can't render; the message says what would help."""


def backends() -> tuple[str, ...]:
    """MuJoCo's renderers to try in turn: the one that the user asked for, or those that need no display."""
    asked = os.environ.get("MUJOCO_GL")
    return (asked,) if asked else _BACKENDS.get(sys.platform, ("glfw",))


def no_renderer() -> str:
    """Why nothing renders, and after a semicolon what to do: another choice if the user made one, else a package."""
    if asked := os.environ.get("MUJOCO_GL"):
        return f"nothing renders with MUJOCO_GL={asked}; unset MUJOCO_GL, or mend what it names"
    return "no OpenGL without a display; install libegl1 or libosmesa6 (Debian's names) to get pictures and videos"


class SceneRenderer:
    """Draws the gripper and one object, wherever they are told to be.

    Args:
      width: of the pictures, pixels.
      height: of the pictures, pixels.
    """

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._child: subprocess.Popen[bytes] | None = None

    def draw(self, parameters: np.ndarray, fingers: np.ndarray, object_position: float) -> np.ndarray:
        """A picture, uint8 ``(height, width, 3)``.

        Args:
          parameters: of the grasp, ``(5,)``, see :meth:`~forcegrasp.physics.GraspParameters.as_array`.
          fingers: positions, metres, ``(2,)``.
          object_position: along the grasp axis, metres.

        Raises:
          NoRendererError: where there is no OpenGL.
        """
        request = np.array([*parameters, *fingers, object_position], float).tobytes()
        if self._child is not None:
            picture = self._ask(self._child, request)
            if picture is not None:
                return picture
            self.close()
        for backend in backends():
            self._child = self._start(backend)
            self._stop = weakref.finalize(self, _stop, self._child)
            picture = self._ask(self._child, request)
            if picture is not None:
                return picture
            self.close()
        raise NoRendererError(no_renderer())

    def close(self) -> None:
        """Ends the process; the next picture starts another one."""
        if self._child is not None:
            self._stop()
            self._child = None

    def __enter__(self) -> SceneRenderer:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _start(self, backend: str) -> subprocess.Popen[bytes]:
        # -P: nothing is imported from the folder that it runs in
        command = [sys.executable, "-P", "-m", __name__, str(self.width), str(self.height)]
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "MUJOCO_GL": backend},
            cwd=tempfile.gettempdir(),
        )

    def _ask(self, child: subprocess.Popen[bytes], request: bytes) -> np.ndarray | None:
        """The process's answer; None if it ended instead."""
        assert child.stdin is not None
        assert child.stdout is not None
        size = (self.height, self.width, 3)
        try:
            child.stdin.write(request)
            child.stdin.flush()
        except BrokenPipeError:
            return None
        answer = child.stdout.read(int(np.prod(size)))
        return np.frombuffer(answer, np.uint8).reshape(size).copy() if len(answer) == np.prod(size) else None


def _stop(child: subprocess.Popen[bytes]) -> None:
    child.kill()
    child.communicate()


class _Scene:
    """One grasp in the process that draws."""

    def __init__(self, parameters: np.ndarray, width: int, height: int) -> None:
        simulator = GraspSimulator(1, threads=1)
        simulator.reset(GraspParameters.from_array(parameters[None]))
        self.model, self.data = simulator.scene(0)
        self.renderer = mujoco.Renderer(self.model, height, width)
        self.camera = mujoco.MjvCamera()
        self.camera.lookat[:] = (0, 0, 0.05)
        self.camera.distance, self.camera.azimuth, self.camera.elevation = 0.21, 180, -25

    def draw(self, fingers: np.ndarray, object_position: float) -> np.ndarray:
        for name, position in zip(("finger_l", "finger_r"), fingers, strict=True):
            self.data.joint(name).qpos[0] = position
        self.data.joint("object").qpos[1] = object_position
        mujoco.mj_kinematics(self.model, self.data)
        self.renderer.update_scene(self.data, self.camera)
        self.renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False  # they take most of the time without a GPU
        return self.renderer.render()


def _serve(requests: BinaryIO, pictures: BinaryIO, width: int, height: int) -> None:
    """Draws until nothing more is asked for."""
    scene, known = None, b""
    while len(request := requests.read(8 * _REQUEST)) == 8 * _REQUEST:
        values = np.frombuffer(request)
        parameters, fingers, object_position = values[:5], values[5:7], float(values[7])
        if scene is None or parameters.tobytes() != known:
            if scene is not None:
                scene.renderer.close()
            scene, known = _Scene(parameters, width, height), parameters.tobytes()
        pictures.write(scene.draw(fingers, object_position).tobytes())
        pictures.flush()


if __name__ == "__main__":
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a driver prints must not get among the pictures
    _serve(sys.stdin.buffer, answers, int(sys.argv[1]), int(sys.argv[2]))
