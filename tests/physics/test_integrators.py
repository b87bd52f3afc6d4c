"""What docs/your-gripper.md says of integrators: by how much each of them shifts the gains of a stiff servo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from scipy.optimize import least_squares

KP, KV, MASS, ROW_S = 4200.0, 127.0, 1.6, 0.01
#: Commands of a ramp there and back, metres, a row each.
RAMPS_M = np.interp(np.arange(110), [0, 5, 35, 60, 80, 110], [0, 0, -0.02, -0.02, 0, 0])


def positions(integrator: str, step_s: float, gains: np.ndarray) -> np.ndarray:
    """Where a servo's slide is at each row, before the row's command acts, metres."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{step_s}" integrator="{integrator}" gravity="0 0 0"/>
        <worldbody><body><joint name="j" type="slide" axis="1 0 0"/><geom size="0.01" mass="{MASS}"/></body></worldbody>
        <actuator><position joint="j" kp="{gains[0] * KP}" kv="{gains[1] * KV}"/></actuator></mujoco>"""
    )
    data, found = mujoco.MjData(model), []
    for command in RAMPS_M:
        found.append(data.qpos[0])
        data.ctrl[0] = command
        mujoco.mj_step(model, data, nstep=round(ROW_S / step_s))
    return np.array(found)


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    return positions("RK4", 1e-4, np.ones(2))


@pytest.mark.parametrize(
    ("integrator", "stiffness", "damping"), [("implicitfast", 0.01, 0.05), ("RK4", 0.002, 0.002), ("Euler", 0.2, 0.2)]
)
def test_gains_that_are_fitted_with_steps_of_2_ms(truth, integrator, stiffness, damping):
    fitted = least_squares(lambda gains: (positions(integrator, 0.002, gains) - truth) / 3e-5, [1, 1], diff_step=1e-4).x
    off = np.abs(fitted - 1)
    assert np.all(off < [stiffness, damping])
    assert integrator != "Euler" or np.all(off > 0.1)
