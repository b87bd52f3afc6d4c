"""What effects contribute to a physics step, and how it gets into the fields of MuJoCo's model."""

from __future__ import annotations

import functools

import numpy as np

from forcegrasp.physics.attached_effects import AttachedEffects
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.model_fields import ModelFields
from forcegrasp.physics.protocols import Contribution


class ContributedFields(ModelFields):
    """Model fields that follow, from step to step, what effects contribute.

    Args and errors as :class:`~forcegrasp.physics.model_fields.ModelFields` has them.
    """

    def __init__(
        self, gripper: Gripper, n: int, tier: str, threads: int, step_factor: float, other_collisions: bool
    ) -> None:
        super().__init__(gripper, n, tier, threads, step_factor, other_collisions)
        self.effects = AttachedEffects(())
        #: What effects contribute to a step, all together: see :class:`~forcegrasp.physics.protocols.Contribution`.
        self.friction, self.damping, self.motor_push = np.zeros((3, n, self.motors))
        self.pad_shift_m, self.finger_push_n, self._contact_shift_m = np.zeros((3, n, 2))
        self.object_push_n = np.zeros(n)
        self._velocity_change, self._more_inertia = np.zeros((2, n, self.motors))
        pushes = self.finger_push_n, self.object_push_n, self.damping, self.motor_push
        changes = self._contact_shift_m, self._velocity_change, self._more_inertia
        totals = self.friction, self.pad_shift_m, *pushes, *changes
        self._contributed = dict(zip(Contribution._fields, totals, strict=True))
        self._forget_friction()

    def _forget_friction(self) -> None:
        """Fields of the friction are what they are without effects."""
        # the friction that effects added last, and which motors' it stiffened, ``(n, motors)``
        self._friction_written: np.ndarray | None = None
        self._friction_active: np.ndarray | None = None

    def _contribute(self) -> bool:
        """Asks effects what they add to this step, and writes what belongs into fields; returns whether any may act."""
        if not self.effects.contribute(self._contributed):
            return False
        self._write_friction()
        self._write_damping()
        self._write_inertia()
        self._write_pad_shift()
        return True

    def _is_given(self, name: str) -> bool:
        """Whether effects contribute anything of this name to this step."""
        return name in self.effects.given and bool(self._contributed[name].any())

    def _write_friction(self) -> None:
        if "dof_frictionloss" not in self._fields and not self._is_given("friction"):
            return
        if self._friction_written is not None and (self.friction == self._friction_written).all():
            return
        self._friction_written = self.friction.copy()
        base = self.base("dof_frictionloss")[:, self._motor_v]
        loss = self.field("dof_frictionloss")[:, self._motor_v] = base + self.friction
        active = loss > base
        if self._friction_active is None or (active != self._friction_active).any():
            self._friction_active = active
            for dof in self.motor_dofs:
                self.stiffen_friction(dof)

    def _write_damping(self) -> None:
        if "dof_damping" in self._fields or self._is_given("damping"):
            self.field("dof_damping")[:, self._motor_v] = self.base("dof_damping")[:, self._motor_v] + self.damping

    def _write_inertia(self) -> None:
        if "dof_armature" in self._fields or self._is_given("inertia"):
            self.field("dof_armature")[:, self._motor_v] = (
                self.base("dof_armature")[:, self._motor_v] + self._more_inertia
            )

    def _write_pad_shift(self) -> None:
        if "geom_pos" not in self._fields and not self._is_given("pad_shift_m"):
            return
        shifts = self.pad_shift_m + self._contact_shift_m
        for side, pads in enumerate(self._pads):
            shift = shifts[:, side : side + 1] * self._outward(side)
            for field, (indices, places) in pads.moved.items():
                self.field(field)[:, indices] = places + shift[:, None]

    def _outward(self, side: int) -> np.ndarray:
        """Direction in which a side's pads open, in the frame of their body, ``(3,)`` or ``(n, 3)``."""
        if self.gripper.is_direct:
            return self._axes[side]
        turned = self.batch.bind("xmat")[:, self._pads[side].body].reshape(-1, 3, 3)
        return turned[:, self.gripper.axis] * (-1.0, 1.0)[side]  # the world's axis, seen from the body

    @functools.cached_property
    def _axes(self) -> list[np.ndarray]:
        """The same of pads that never turn, ``(3,)`` each."""
        return [self._signs[f.motor] * self.model.joint(f.joint).axis for f in self.gripper.fingers]
