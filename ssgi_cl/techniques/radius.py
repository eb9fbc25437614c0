"""Radius of ambient occlusion and of SSDO: a default that suits what is seen, and a warning of one that does not."""

from __future__ import annotations

from typing import Any

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import Floats, GBuffer
from ssgi_cl.core.seen_extent import default_radius, seen_extent, sparse, warn_of_radius
from ssgi_cl.device.gbuffer import DeviceGBuffer


def sensible_radius(gbuffer: GBuffer | DeviceGBuffer, radius: Any = None) -> Any:
    """Return `radius`, a number or several, by default 5 % of the picture's diagonal where surfaces are seen.

    `RadiusWarning`: one reaches less than a pixel, or over the image, in a `GBuffer`.
    """
    if not isinstance(gbuffer, (GBuffer, DeviceGBuffer)):
        raise TypeError(f"gbuffer is {type(gbuffer).__name__}: expected GBuffer or DeviceGBuffer")
    if radius is None:
        camera, depth = _seen(gbuffer)
        return default_radius(seen_extent(camera, sparse(depth)))
    if isinstance(gbuffer, GBuffer) and gbuffer.band is None:
        camera, depth = _seen(gbuffer)
        for each in radius if isinstance(radius, tuple) else (radius,):
            warn_of_radius(each, camera, depth)
    return radius


def _seen(gbuffer: GBuffer | DeviceGBuffer) -> tuple[Camera, Floats]:
    """Return the camera and the depth of the front layer."""
    if isinstance(gbuffer, GBuffer):
        depth: Any = gbuffer.first("depth")
        return gbuffer.camera, gbuffer.inner(depth)
    if gbuffer.camera is None:
        raise ValueError("the device G-buffer is empty: draw or upload something first")
    (rows, columns), depth = gbuffer.margin, gbuffer.depth.download()[0]
    return gbuffer.camera, depth[rows : depth.shape[0] - rows, columns : depth.shape[1] - columns]
