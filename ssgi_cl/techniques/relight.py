"""Relighting: new lights on a photograph or render, and a depth map as a lit relief.

Both take direct light with the shadows of visible surfaces and one bounce from `ssdo`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.depth_maps import DepthKeywords, linear_color
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.core.lights import DirectionalLight, Environment, Light
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.techniques.ao.gtao import gtao
from ssgi_cl.techniques.filters.tonemap import tonemap
from ssgi_cl.techniques.ssdo.ssdo import ssdo

ALBEDO = 0.8
"""Reflectance where a G-buffer has none; of an image without one, that of its brightest hundredth."""
_SUN = (0.5, -0.7, -0.5)
"""Direction of the light of a relief in view space: from the upper left, behind the viewer."""


@serialised
def relight(
    gbuffer: GBuffer,
    image: ArrayLike,
    lights: Sequence[Light],
    *,
    radius: float | None = None,
    replaced: bool = False,
    ao: bool = True,
    runtime: Runtime | None = None,
) -> NDArray[np.float32]:
    """Add lights to a photograph or render, or light it anew.

    Reflectance is the G-buffer's albedo; without one, the image divided by its brightest hundredth, times
    .8, which takes its shading for paint.

    Args:
        gbuffer: what the image shows, of its size and without a margin.
        image: [rows, columns, 3] radiance in W m^-2 sr^-1, >= 0, linear; integers are a photograph in sRGB.
        lights: in world space; of a G-buffer without a camera's `view`, that is the camera's space.
        radius: distance up to which surfaces occlude and send light, scene units; by default 5 % of the
            picture's diagonal where surfaces are seen.
        replaced: whether the lights take the place of the image's own light.
        ao: whether ambient occlusion dims the image's own light.
        runtime: the device; by default the fastest found.

    Returns:
        [rows, columns, 3] float32 radiance in W m^-2 sr^-1; where nothing is there, the image.

    Raises:
        TypeError, ValueError: an argument of the wrong type, shape or range.
    """
    plain = _without_kind(gbuffer)
    given = checks.as_array("image", image)
    own = linear_color(given) if given.dtype.kind in "iu" else checks.plane("image", given, channels=3, low=0.0)
    if own.shape != (*plain.size, 3):
        raise ValueError(f"image has shape {own.shape}: expected {(*plain.size, 3)} as the G-buffer")
    if plain.margin != (0, 0):
        raise ValueError(f"gbuffer has the margin {plain.margin}: expected none")
    if plain.albedo is None:
        white = float(np.quantile(own.max(axis=-1), 0.99)) or 1.0
        plain = replace(plain, albedo=np.clip(own * (ALBEDO / white), 0.0, 1.0))
    lit = _reflected(plain, lights, radius, runtime)
    kept = np.zeros_like(own) if replaced else own
    if ao and not replaced:
        kept = own * gtao(plain, radius, runtime=runtime)[..., None]
    there = np.isfinite(plain.first("depth"))[..., None]  # type: ignore[arg-type]
    result: NDArray[np.float32] = np.where(there, kept + lit, own).astype(np.float32)
    return result


@checked_keywords
def shade_depth(
    depth: Any,
    *,
    lights: Sequence[Light] | None = None,
    color: Any = None,
    radius: float | None = None,
    exposure: float | None = None,
    runtime: Runtime | None = None,
    **reading: Unpack[DepthKeywords],
) -> Any:
    """Show a depth map as a lit relief.

    Args:
        depth: [rows, columns] or [images, rows, columns], as of `GBuffer.from_depth`.
        lights: in world space; by default a sun from the upper left and an even sky.
        color: reflectance, as of `GBuffer.from_depth`; by default .8.
        radius: as of `relight`.
        exposure: as of `tonemap`.
        runtime: the device; by default the fastest found.
        **reading: how the depth is read, such as K, kind and scale: as of `GBuffer.from_depth`.

    Returns:
        [rows, columns, 3] uint8, sRGB; with the images of a batch before. Of the kind of `depth`.

    Raises:
        TypeError, ValueError: as `GBuffer.from_depth` and `ssdo`.
    """
    gbuffer = GBuffer.from_depth(depth, color=color, **reading)
    return _relief(gbuffer, lights, radius=radius, exposure=exposure, runtime=runtime)  # type: ignore[arg-type]


@serialised
def normals_from_depth(gbuffer: GBuffer, *, runtime: Runtime | None = None) -> NDArray[np.float32]:
    """Return the normals that techniques take of a G-buffer's depth.

    Each is that of the plane through the pixel and those neighbours that lie on its surface.

    Args:
        gbuffer: its depth counts, its normals do not.
        runtime: the device; by default the fastest found.

    Returns:
        [rows, columns, 3] float32, world space, unit length, facing the viewer; 0 where nothing is there.
    """
    device = on_device(replace(_without_kind(gbuffer), normal=None), runtime)
    with device.runtime.frame():
        seen = device.normal.download()[:3]
    rows, columns = gbuffer.margin
    inner = np.moveaxis(seen, 0, -1)[rows : rows + gbuffer.size[0], columns : columns + gbuffer.size[1]]
    return np.ascontiguousarray(inner @ gbuffer.camera.view[:3, :3].astype(np.float32))


@serialised
def _relief(
    gbuffer: GBuffer,
    lights: Sequence[Light] | None,
    *,
    radius: float | None,
    exposure: float | None,
    runtime: Runtime | None,
) -> NDArray[np.uint8]:
    plain = _without_kind(gbuffer)
    if lights is None:
        sun = np.asarray(_SUN) @ plain.camera.view[:3, :3]
        lights = [DirectionalLight(sun, 2.5), Environment(0.6)]
    return tonemap(_reflected(plain, lights, radius, runtime), exposure=exposure, runtime=runtime)


def _reflected(
    gbuffer: GBuffer, lights: Sequence[Light], radius: float | None, runtime: Runtime | None
) -> NDArray[np.float32]:
    """Return the radiance of surfaces under lights alone, [rows, columns, 3]; 0 where nothing is."""
    direct, bounce = ssdo(gbuffer, lights, radius, runtime=runtime)[:2]
    albedo = gbuffer.first("albedo")
    reflectance = np.float32(ALBEDO) if albedo is None else gbuffer.inner(albedo)
    light = direct if bounce is None else direct + bounce
    result: NDArray[np.float32] = (reflectance * light * np.float32(1.0 / np.pi)).astype(np.float32)
    return result


def _without_kind(gbuffer: GBuffer) -> GBuffer:
    """Return a G-buffer whose results are numpy arrays."""
    if not isinstance(gbuffer, GBuffer):
        raise TypeError(f"gbuffer is {type(gbuffer).__name__}: expected GBuffer")
    return gbuffer.of_kind(np.empty(0))
