"""Texels of reflective shadow maps in float64, and the Hilbert curve along them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.reference.gbuffer import Doubles

LEAST_COSINE = 0.1
"""A texel that the light meets at a flatter angle has the area that it has at this cosine."""
MOST_AREA = 1e30
"""Greatest area of a texel, square scene units."""


def texels(rsm: ReflectiveShadowMap) -> tuple[Doubles, Doubles, Doubles]:
    """Return position from the first camera, normal to the light, area; [rows, columns(, 3)].

    A texel's area is that of its beam where it meets the surface: its solid angle
    |dx dy| cos^3 (dx, dy its sides at distance 1 along the axis) times the squared distance, over
    the cosine of the surface; of an orthographic camera its own area over the cosine. Positions
    come from the depth where the given ones say the same within 4 roundings of float32, and are
    the given ones elsewhere. All is 0 where nothing is.
    """
    depth = np.asarray(rsm.depth, np.float64)
    rows = len(depth) // len(rsm.cameras)
    there = np.isfinite(depth)
    depth = np.where(there, depth, 1.0)
    origin = rsm.cameras[0].position
    position, to_light, section = (np.zeros((*depth.shape, 3)) for _ in range(3))
    for face, camera in enumerate(rsm.cameras):
        own = np.s_[face * rows : (face + 1) * rows]
        width, height = (abs(length) for length in camera.pixel_to_view[:2])
        axis = -camera.view[2, :3]
        x, y = _slopes(camera)
        if camera.is_orthographic:
            local = np.stack([x, y, -depth[own]], axis=-1)
            to_light[own], section[own] = -axis, width * height
        else:
            local = np.stack([x, y, -np.ones_like(x)], axis=-1) * depth[own][..., None]
            distance = np.linalg.norm(local, axis=-1, keepdims=True)
            to_light[own] = -(local / distance) @ camera.view[:3, :3]
            cosine = depth[own][..., None] / distance
            section[own] = width * height * cosine**3 * distance**2
        position[own] = local @ camera.view[:3, :3] + (camera.position - origin)
    given = np.asarray(rsm.position, np.float64)
    rounding = 4.0 * np.spacing(np.abs(given).max(axis=-1, keepdims=True).astype(np.float32))
    said = given - origin
    position = np.where(np.abs(position - said) <= rounding, position, said)
    normal = np.asarray(rsm.normal, np.float64)
    cosine = np.sum(normal * to_light, axis=-1, keepdims=True)
    area = (section / np.maximum(np.abs(cosine), LEAST_COSINE))[..., 0]
    normal = np.where(cosine < 0.0, -normal, normal)
    seen = there[..., None]
    return position * seen, normal * seen, np.minimum(area, MOST_AREA) * there


def _slopes(camera: Camera) -> tuple[Doubles, Doubles]:
    """Return x and y [rows, columns] of pixel centres at depth 1 (orthographic: at any)."""
    to_x, to_y, at_x, at_y = camera.pixel_to_view
    rows, columns = camera.size
    y, x = np.mgrid[:rows, :columns] + 0.5
    return at_x + to_x * x, at_y + to_y * y


def mirrored_axes(rsm: ReflectiveShadowMap) -> Doubles:
    """Return [rows, columns, 3]: r = d - 2 (n . d) n of the light's ray d; 0 where nothing is."""
    position, normal, _ = texels(rsm)
    camera = rsm.cameras[0]
    if camera.is_orthographic:
        ray = np.broadcast_to(-camera.view[2, :3], position.shape)
    else:
        length = np.linalg.norm(position, axis=-1, keepdims=True)
        ray = np.divide(position, length, out=np.zeros_like(position), where=length > 0.0)
    mirrored: Doubles = ray - 2.0 * np.sum(normal * ray, axis=-1, keepdims=True) * normal
    return mirrored * np.isfinite(rsm.depth)[..., None]


def face_rotations() -> Doubles:
    """Return [6, 3, 3] rotations from the world to the views of the faces +x, -x, +y, -y, +z, -z.

    Rows are right, up and back; up is +y for x, +z for y, +x for z.
    """
    rotations = []
    for axis in range(3):
        up = np.eye(3)[(axis + 1) % 3]
        for sign in (1.0, -1.0):
            forward = sign * np.eye(3)[axis]
            rotations.append(np.stack([np.cross(forward, up), up, -forward]))
    return np.stack(rotations)


def hilbert_order(rows: int, columns: int) -> NDArray[np.intp]:
    """Return the flat indices of an image's pixels along Hilbert's curve (1891).

    The curve of the least power of two that holds the image, made of four of half the side: the
    first transposed, the second below and the third to the right of that as they are, the fourth
    above mirrored at the other diagonal.
    """
    order = 0
    while 2**order < max(rows, columns):
        order += 1
    curve = np.zeros((1, 2), int)  # column, row
    for level in range(max(order, 1)):
        half = 2**level
        curve = np.concatenate(
            [
                curve[:, ::-1],
                curve + np.array([0, half]),
                curve + half,
                np.array([2 * half - 1, half - 1]) - curve[:, ::-1],
            ]
        )
    inside = curve[(curve[:, 0] < columns) & (curve[:, 1] < rows)]
    index: NDArray[np.intp] = inside[:, 1] * columns + inside[:, 0]
    return index
