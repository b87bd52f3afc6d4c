"""The force of MuJoCo's contacts, against the engine, and the depth at which it is the same at another speed."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from forcegrasp.physics.contact_law import ContactLaw, contact_numbers

_SCENE = """
<mujoco>
  <option gravity="0 0 0"><flag multiccd="disable"/></option>
  <worldbody>
    <geom name="wall" type="plane" size="1 1 1" solref="{solref}" solimp="{solimp}" priority="1"/>
    <body><joint type="slide" axis="0 0 1"/><geom type="sphere" size="0.01" condim="1"/></body>
  </worldbody>
</mujoco>
"""
_SOLREFS, _SOLIMPS = (
    ("0.02 1", "0.03 0.7", "-2000 -80"),
    ("0 0.99 0.0065 0.5 2", "0.5 0.95 0.004 0.3 3", "0.9 0.95 0.001"),
)


def _numbers(text: str, count: int) -> np.ndarray:
    given = [float(word) for word in text.split()]
    return np.array([given + [0.5, 2.0][len(given) - count :] if len(given) < count else given])


def _pressed(model: mujoco.MjModel, depth: float, speed: float) -> float:
    """Force where the body is held still by what is applied to it: its acceleration is 0."""
    data = mujoco.MjData(model)
    data.qpos[0], data.qvel[0] = 0.01 - depth, -speed
    for _ in range(500):  # until force and what holds against it are one
        mujoco.mj_forward(model, data)
        data.qfrc_applied[0] = -data.efc_force.sum()
    return float(data.efc_force.sum())


@pytest.mark.parametrize("solref", _SOLREFS)
@pytest.mark.parametrize("solimp", _SOLIMPS)
def test_force_is_the_engines(solref, solimp):
    model = mujoco.MjModel.from_xml_string(_SCENE.format(solref=solref, solimp=solimp))
    law = ContactLaw(contact_numbers(_numbers(solref, 2), _numbers(solimp, 5)), np.zeros((1, 1)))

    def expected(depth: float, speed: float) -> float:
        return float(law.force(np.array([depth]), law.damping * speed)[0])

    reference = _pressed(model, 3e-4, 0.002) / expected(3e-4, 0.002)
    for depth, speed in ((1e-4, 0.0), (5e-4, 0.004), (5e-4, -0.0002), (9e-4, 0.001)):
        assert _pressed(model, depth, speed) / reference == pytest.approx(expected(depth, speed), rel=1e-3)


@pytest.mark.parametrize("solimp", _SOLIMPS)
@pytest.mark.parametrize("speed", [-0.02, 0.0, 0.01])
@pytest.mark.parametrize("behind", [(0.0,), (0.0, 3e-4, 3e-4, np.inf)])
def test_depth_presses_as_hard_at_another_speed(solimp, speed, behind):
    depth, rows = np.linspace(1e-4, 5e-3, 40), np.ones((40, 1))
    law = ContactLaw(rows * contact_numbers(_numbers("0.02 1", 2), _numbers(solimp, 5)), rows * np.array(behind))
    still = law.force(depth, np.zeros(40))
    found = law.depth(still, law.damping * speed, depth)
    near = 1e-6  # where contacts press harder however shallow, next to 0 is right
    assert np.all(law.force(np.maximum(found - near, 0.0), law.damping * speed) <= still)
    assert np.all(law.force(found + near, law.damping * speed) >= still)
    np.testing.assert_array_equal(law.depth(np.zeros(40), law.damping * speed, depth), 0.0)


def test_pads_that_lie_behind_press_later():
    numbers = np.tile(contact_numbers(_numbers("0.02 1", 2), _numbers("0 0.99 0.0065", 5)), (2, 1))
    law, alone = ContactLaw(numbers, np.array([[0.0, 1e-3]] * 2)), ContactLaw(numbers, np.zeros((2, 1)))
    depth, none = np.array([0.9e-3, 2.5e-3]), np.zeros(2)
    expected = alone.force(depth, none) + np.array([0.0, alone.force(np.array([1.0, 1.5e-3]), none)[1]])
    np.testing.assert_allclose(law.force(depth, none), expected, rtol=1e-12)


def test_impedance_rises_by_its_slope():
    depth, rows = np.linspace(1e-5, 9e-3, 50), np.ones((50, 1))
    for solimp in _SOLIMPS:
        law = ContactLaw(rows * contact_numbers(_numbers("0.02 1", 2), _numbers(solimp, 5)), np.zeros((50, 1)))
        (low, slope), (high, _) = law.impedance(depth[:, None]), law.impedance(depth[:, None] + 1e-9)
        np.testing.assert_allclose((high - low) / 1e-9, slope, rtol=1e-3, atol=1e-3)
