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
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import default_gripper, load_gripper
from forcegrasp.physics.parameters import GraspParameters
from forcegrasp.physics.simulator import GraspSimulator

_BACKENDS = {"linux": ("egl", "osmesa"), "darwin": ("cgl",)}
#: Numbers that describe a grasp.
_PARAMETERS = 5
# How far away the camera stands, for each metre that the gripper opens.
_DISTANCE = 7 / 3


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
      gripper: that is drawn; the paper's by default.
    """

    def __init__(self, width: int, height: int, gripper: Gripper | None = None) -> None:
        self.width, self.height, self.gripper = width, height, gripper or default_gripper()
        self._child: subprocess.Popen[bytes] | None = None

    def draw(self, parameters: np.ndarray, position: np.ndarray, object_position: float) -> np.ndarray:
        """A picture, uint8 ``(height, width, 3)``.

        Args:
          parameters: of the grasp, ``(5,)``, see :meth:`~forcegrasp.physics.GraspParameters.as_array`.
          position: of the motors, m or rad, ``(motors,)``.
          object_position: along the grasp axis, metres.

        Raises:
          NoRendererError: where there is no OpenGL.
        """
        request = np.array([*parameters, *position, object_position], float).tobytes()
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
        name = self.gripper.name if self.gripper.is_shipped else str(self.gripper.path.resolve())
        command = [sys.executable, "-P", "-m", __name__, str(self.width), str(self.height), name]
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

    def __init__(self, gripper: Gripper, parameters: np.ndarray, width: int, height: int) -> None:
        self.simulator = simulator = GraspSimulator(1, threads=1, gripper=gripper)
        simulator.reset(GraspParameters.from_array(parameters[None]))
        self.model, self.data = simulator.scene(0)
        self.renderer = mujoco.Renderer(self.model, height, width)
        self.camera = mujoco.MjvCamera()
        body = self.model.geom(gripper.object_geom).bodyid[0]
        self.camera.lookat[:] = self.model.body_pos[body]
        self.camera.distance = _DISTANCE * gripper.opening.opening_m[-1]
        # seen along the third axis of the grasp: the fingers close from left and right
        self.camera.azimuth, self.camera.elevation = (90, 180, 180)[gripper.axis], -25

    def draw(self, position: np.ndarray, object_position: float) -> np.ndarray:
        self.data.qpos[:] = self.simulator.plant.posed(position, object_position)
        mujoco.mj_kinematics(self.model, self.data)
        self.renderer.update_scene(self.data, self.camera)
        self.renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False  # they take most of the time without a GPU
        return self.renderer.render()


def _serve(requests: BinaryIO, pictures: BinaryIO, width: int, height: int, gripper: Gripper) -> None:
    """Draws until nothing more is asked for."""
    scene, known = None, b""
    size = 8 * (_PARAMETERS + len(gripper.motors) + 1)
    while len(request := requests.read(size)) == size:
        values = np.frombuffer(request)
        parameters, position, object_position = values[:_PARAMETERS], values[_PARAMETERS:-1], float(values[-1])
        if scene is None or parameters.tobytes() != known:
            if scene is not None:
                scene.renderer.close()
            scene, known = _Scene(gripper, parameters, width, height), parameters.tobytes()
        pictures.write(scene.draw(position, object_position).tobytes())
        pictures.flush()


if __name__ == "__main__":
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a driver prints must not get among the pictures
    _serve(sys.stdin.buffer, answers, int(sys.argv[1]), int(sys.argv[2]), load_gripper(sys.argv[3]))
