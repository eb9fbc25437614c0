"""The view of the rasteriser's kernels: camera, scene and image as the struct `RasterView`."""

from __future__ import annotations

from typing import Any

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, ints
from ssgi_cl.rasterize.raster.device_scene import DeviceScene

PEEL = 1e-5
"""A deeper layer begins this much behind the one before, relative to its depth; orthographic: to the view's height."""
PEEL_ROUNDING = 2.0**-22
"""Orthographic: that much relative to its depth comes on top, for roundings of float32."""

_PLACE = (*ROTATION, "x", "y", "z", "eye_x", "eye_y", "eye_z", "rest_x", "rest_y", "rest_z")
"""World to view (rotation, translation), and the eye from the scene's origin with what float32 loses of it."""

VIEW = Struct(
    "RasterView",
    (
        *floats(*_PLACE, "columns", "rows", "near_depth", "far_depth", "furthest_d", "peel", "peel_more", "matt"),
        *ints("tiles_x", "tiles_y", "capacity", "pair_capacity", "vertex_stride", "triangle_stride"),
        *ints("layer", "margin_x", "margin_y", "back"),
    ),
)
STRUCTS = (CAMERA, VIEW)


def view_values(scene: DeviceScene, camera: Camera, target: DeviceGBuffer, **values: float) -> dict[str, Any]:
    """Return the members of `VIEW` for layer 0; `values` are those that the rasteriser decides."""
    turn = camera.view[:3, :3]
    # In float64: the camera's position relative to the scene's origin may be a small difference of large numbers.
    shift = turn @ scene.origin + camera.view[:3, 3]
    eye = camera.position - scene.origin
    rest = eye - eye.astype(np.float32)
    orthographic = camera.is_orthographic
    return {
        **dict(zip(_PLACE, (*turn.ravel(), *shift, *eye, *rest), strict=True)),
        "columns": target.whole[1],
        "rows": target.whole[0],
        "near_depth": max(camera.near, 1e-30),
        "far_depth": camera.far,
        "furthest_d": -camera.far if orthographic else 1.0 / camera.far,
        "peel": 1.0 + PEEL_ROUNDING if orthographic else 1.0 - PEEL,
        "peel_more": PEEL * camera.view_height if orthographic else 0.0,
        "vertex_stride": scene.vertex_stride,
        "triangle_stride": scene.triangle_stride,
        "layer": 0,
        "margin_x": target.margin[1],
        "margin_y": target.margin[0],
        "back": back_area(camera) if scene.culls else 0,
        **values,
    }


def back_area(camera: Camera) -> int:
    """Return the sign that areas of triangles have in pixels, rows downwards, where their back is seen."""
    across, down = camera.pixel_to_view[:2]
    return 1 if across * down < 0.0 else -1
