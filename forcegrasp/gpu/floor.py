"""Depths at which an upright cylinder stands in the floor, as exact as float32 allows.

MuJoCo Warp finds a tilt's part in them from 1 − cos² of the angle, which in float32 is 0 below 0.02°. The object then
rocks within that angle: fingertip forces flicker by up to 20 mN, more than a sensor's noise. Here the sine is used.
"""

# pyright: standard, reportMissingImports=false, reportGeneralTypeIssues=false, reportInvalidTypeForm=false

from __future__ import annotations

from collections.abc import Callable

import mujoco_warp as mjw
import warp as wp


@wp.kernel
def _correct(
    floor: int,
    cylinder: int,
    size: wp.array2d[wp.vec3],
    geom_position: wp.array2d[wp.vec3],
    geom_rotation: wp.array2d[wp.mat33],
    contacts: wp.array[int],
    world: wp.array[int],
    geoms: wp.array[wp.vec2i],
    depth: wp.array[float],
    position: wp.array[wp.vec3],
):
    contact = wp.tid()
    if contact >= contacts[0]:
        return
    pair = geoms[contact]
    if pair[0] != floor or pair[1] != cylinder:
        return
    w = world[contact]
    center = geom_position[w, cylinder]
    rotation = geom_rotation[w, floor]
    normal = wp.vec3(rotation[0, 2], rotation[1, 2], rotation[2, 2])
    rotation = geom_rotation[w, cylinder]
    axis = wp.vec3(rotation[0, 2], rotation[1, 2], rotation[2, 2])
    if wp.dot(axis, normal) > 0.0:
        axis = -axis  # towards the floor
    cosine = -wp.dot(axis, normal)
    if cosine < 0.9:
        return  # it lies, and rests on its side
    lean = axis + normal * cosine  # as long as the sine
    to_end = axis * size[w % size.shape[0], cylinder][1]
    rim = position[contact] - center - to_end  # from the middle of the lower end, whose plane holds it
    height = wp.dot(center - geom_position[w, floor], normal) + wp.dot(to_end, normal)
    exact = height + wp.dot(rim, lean) / cosine
    position[contact] = position[contact] + normal * (0.5 * (depth[contact] - exact))
    depth[contact] = exact


def exact_depths(floor: int, cylinder: int) -> Callable[[mjw.Model, mjw.Data], None]:
    """Returns what corrects the contacts of two geoms, between their detection and what is made of them."""

    def correct(model: mjw.Model, data: mjw.Data) -> None:
        contact = data.contact
        wp.launch(
            _correct,
            dim=data.naconmax,
            inputs=[floor, cylinder, model.geom_size, data.geom_xpos, data.geom_xmat, data.nacon],
            outputs=[contact.worldid, contact.geom, contact.dist, contact.pos],
        )

    return correct
