"""Where an upright cylinder touches the floor, as exact as float32 allows.

MuJoCo Warp 4.0 finds a tilt's part in the depths from 1 − cos² of its angle. In float32 that is 0 or rounding below
0.02°: the object rocks within that angle, and forces flicker by more than a sensor's noise. Here the sine is used.
"""

# pyright: standard, reportMissingImports=false, reportArgumentType=false, reportAttributeAccessIssue=false
# pyright: reportCallIssue=false, reportIndexIssue=false, reportOperatorIssue=false, reportInvalidTypeForm=false

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
    radius, half_length = size[w % size.shape[0], cylinder][0], size[w % size.shape[0], cylinder][1]
    end = center + axis * half_length
    rim = position[contact] - end
    rim = wp.normalize(rim - normal * wp.dot(rim, normal)) * radius
    rim = rim + normal * (wp.dot(rim, lean) / cosine)  # in the plane of the lower end
    exact = wp.dot(end + rim - geom_position[w, floor], normal)
    position[contact] = end + rim - normal * (0.5 * exact)
    depth[contact] = exact


#: Rounding may put a point above the floor that is in it; nearer than this it is a contact to be corrected. Metres.
GAP_M = 0.02


def exact_contacts(floor: int, cylinder: int) -> Callable[[mjw.Model, mjw.Data], None]:
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
