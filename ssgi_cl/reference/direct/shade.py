"""Deferred shading in float64, light by light as defined in `ssgi_cl.techniques.direct.shade`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.reference.ao.multi_bounce import multi_bounce_reference
from ssgi_cl.reference.direct.ambient import ambient_reference
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView, view_normals
from ssgi_cl.reference.phong import Lobes

PunctualLight = SpotLight | PointLight | DirectionalLight

LEAST_N_DOT_V = 0.0017
"""Cosine between a normal and the light below which a surface counts as no more tilted."""
FACET = 0.4
"""Factor of SLOPE and LEAST on receivers whose plane is that of their triangle."""
REACH = 1
"""Texels on either side of the receiver's own that the shadow's filter covers."""
SLOPE, LEAST, STEP, ROUNDING = 0.25, 0.25, 1.0, 1e-5
"""Bias of the comparison of depths; see kernels/direct/shadow.clh."""
SOFT_SEARCH, SOFT_TAPS = 40, 48
SOFT_FARTHEST, SOFT_LEAST, SOFT_NEAREST = 128.0, 1.5, 8.0
"""Of lights with a size, see kernels/direct/soft_shadow.clh."""


def shade_reference(
    gbuffer: GBuffer,
    lights: Sequence[Light],
    *,
    shadow_maps: Sequence[ReflectiveShadowMap | None] | None = None,
    ao: ArrayLike | None = None,
    indirect: ArrayLike | None = None,
    multi_bounce: bool = False,
    indirect_ao: bool = False,
) -> Doubles:
    """Return radiance [rows, columns, 3]; the arguments are those of `shade`."""
    position, normal, there = world_surface(gbuffer)
    irradiance = np.zeros((*gbuffer.size, 3))
    maps = list(shadow_maps) if shadow_maps is not None else [None] * len(lights)
    shares = [
        (light, np.ones(gbuffer.size) if rsm is None else shadow_reference(rsm, position, normal, light_extent(light)))
        for light, rsm in zip(lights, maps, strict=True)
        if not isinstance(light, Environment)
    ]
    for light, share in shares:
        irradiance += direct_reference(light, position, normal) * share[..., None]
    environments = [light for light in lights if isinstance(light, Environment)]
    ambient = ambient_reference(environments, normal)
    albedo = gbuffer.first("albedo")
    reflectance = 0.8 if albedo is None else gbuffer.inner(albedo).astype(np.float64)
    if ao is not None and multi_bounce:
        ambient *= multi_bounce_reference(ao, reflectance)
    elif ao is not None:
        ambient *= np.asarray(ao, np.float64)[..., None]
    irradiance += ambient
    if indirect is not None:
        dimmed = np.asarray(ao, np.float64)[..., None] if indirect_ao and ao is not None else 1.0
        irradiance += dimmed * np.asarray(indirect, np.float64)
    radiance = reflectance * irradiance / np.pi
    specular, gloss = gbuffer.first("specular"), gbuffer.first("gloss")
    if specular is not None and gloss is not None:
        lobes = Lobes.of(gbuffer, position, normal).widened()
        for light, share in shares:
            radiance += lobes.reflected(light, position, normal) * share[..., None]
    emission = gbuffer.first("emission")
    if emission is not None:
        radiance += gbuffer.inner(emission)
    return np.where(there[..., None], radiance, sky_reference(environments, gbuffer.camera))


def light_extent(light: Light) -> float:
    """Return the radius of a light, scene units, or the tangent of a directional light's angle."""
    if isinstance(light, DirectionalLight):
        return math.tan(light.angle)
    return 0.0 if isinstance(light, Environment) else light.radius


def world_surface(gbuffer: GBuffer) -> tuple[Doubles, Doubles, NDArray[np.bool_]]:
    """Return position and normal [rows, columns, 3] in world space, and where something is.

    Normals face the viewer; where nothing is, the position is that at depth 1.
    """
    view = SurfaceView.of(gbuffer)
    depth = view.inner(view.depth)
    there = np.isfinite(depth)
    row, column = (view.inner(centre) for centre in view.centres())
    seen = view.position(row, column, np.where(there, depth, 1.0))
    turn, shift = gbuffer.camera.view[:3, :3], gbuffer.camera.view[:3, 3]
    normal = view.inner(view_normals(view, gbuffer.first("normal"))) @ turn
    return (seen - shift) @ turn, normal, there


def direct_reference(light: PunctualLight, position: Doubles, normal: Doubles) -> Doubles:
    """Return irradiance [..., 3] in W/m^2 of surfaces in world space, without shadows."""
    if isinstance(light, DirectionalLight):
        cosine = -normal @ np.asarray(light.direction)
        received: Doubles = np.maximum(cosine, 0.0)[..., None] * np.asarray(light.irradiance)
        return received
    to_light = np.asarray(light.position) - position
    squared = np.sum(to_light * to_light, axis=-1)
    distance = np.sqrt(np.where(squared > 0.0, squared, 1.0))
    cosine = np.sum(normal * to_light, axis=-1) / distance
    strength = np.maximum(cosine, 0.0) / distance**2
    if isinstance(light, SpotLight):
        along = -to_light @ np.asarray(light.direction) / distance
        strength = np.where(along >= np.cos(light.cone_angle), strength, 0.0)
    irradiance: Doubles = strength[..., None] * np.asarray(light.intensity)
    return irradiance


def sky_reference(environments: Sequence[Environment], camera: Camera) -> Doubles:
    """Return radiance [rows, columns, 3] of the environments along every view ray."""
    start = camera.unproject(np.zeros(camera.size, np.float32))
    along = camera.unproject(np.ones(camera.size, np.float32)) - start
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    result = np.zeros((*camera.size, 3))
    for environment in environments:
        image = np.asarray(environment.radiance)
        image = image.reshape(1, 1, 3) if image.ndim == 1 else image
        rows, columns = image.shape[:2]
        azimuth = np.arctan2(along[..., 0], -along[..., 2])
        polar = np.arccos(np.clip(along[..., 1], -1.0, 1.0))
        column = np.clip((azimuth / (2.0 * np.pi) + 0.5) * columns, 0, columns - 1).astype(int)
        row = np.clip(polar / np.pi * rows, 0, rows - 1).astype(int)
        result += image[row, column]
    return result


def shadow_reference(rsm: ReflectiveShadowMap, position: Doubles, normal: Doubles, extent: float = 0.0) -> Doubles:
    """Return the share of light [rows, columns] that reaches surfaces in world space.

    Args:
        rsm: whose depth counts.
        extent: the light's radius, or the tangent of a directional light's angle.
        position, normal: [rows, columns, 3]; normals of unit length.
    """
    cameras = rsm.cameras
    depth = np.asarray(rsm.depth, np.float64).reshape(len(cameras), *cameras[0].size)

    def of_face(camera: Camera, seen: Doubles) -> Doubles:
        if extent > 0.0:
            return soft_face_shadow_reference(camera, seen, position, normal, extent)
        return face_shadow_reference(camera, seen, position, normal)

    if len(cameras) == 1:
        return of_face(cameras[0], depth[0])
    to_point = position - np.asarray(cameras[0].position)
    axis = np.argmax(np.abs(to_point), axis=-1)
    main = np.take_along_axis(to_point, axis[..., None], axis=-1)[..., 0]
    face = 2 * axis + (main < 0.0)
    result = np.ones(face.shape)
    for index, camera in enumerate(cameras):
        result = np.where(face == index, of_face(camera, depth[index]), result)
    return result


def face_shadow_reference(
    camera: Camera, seen: Doubles, position: Doubles, normal: Doubles, is_facet: NDArray[np.bool_] | None = None
) -> Doubles:
    """Return the share of light by one image of a map.

    Args:
        camera: that drew the image.
        seen: its depth.
        position, normal: as for `shadow_reference`.
        is_facet: [rows, columns] whether `normal` is that of the triangle; nowhere by default.
    """
    at = MapReceiver.of(camera, seen, position, normal, is_facet)
    column, row = at.column, at.row
    left, top = np.floor(column - 0.5), np.floor(row - 0.5)
    fx, fy = column - 0.5 - left, row - 0.5 - top
    last = 2 * REACH + 1
    blocked = np.zeros_like(at.own)
    for j in range(last + 1):
        ty = np.clip(top.astype(int) - REACH + j, 0, camera.height - 1)
        weight_y = 1.0 - fy if j == 0 else fy if j == last else 1.0
        for i in range(last + 1):
            tx = np.clip(left.astype(int) - REACH + i, 0, camera.width - 1)
            weight_x = 1.0 - fx if i == 0 else fx if i == last else 1.0
            nearer = at.nearness[ty, tx] > at.limit(tx + 0.5 - column, ty + 0.5 - row)
            blocked += np.where(nearer, weight_x * weight_y, 0.0)
    return np.maximum(1.0 - blocked / last**2, 0.0)


@dataclass(frozen=True, eq=False)
class MapReceiver:
    """Surfaces in one image of a shadow map. Nearness is 1 / depth, or -depth; greater is nearer.

    Attributes:
        column, row: texels of the image.
        own: their nearness.
        slope_x, slope_y: change of their tangent plane's nearness from one texel to the next.
        slack: what a texel must be nearer by.
        texel: a texel's width as a difference of nearness.
        nearness: [rows, columns] of the image's texels.
    """

    column: Doubles
    row: Doubles
    own: Doubles
    slope_x: Doubles
    slope_y: Doubles
    slack: Doubles
    texel: Doubles
    nearness: Doubles

    @classmethod
    def of(
        cls,
        camera: Camera,
        seen: Doubles,
        position: Doubles,
        normal: Doubles,
        is_facet: NDArray[np.bool_] | None = None,
    ) -> MapReceiver:
        """Return those of surfaces in world space; see `face_shadow_reference`."""
        part = np.where(False if is_facet is None else is_facet, FACET, 1.0)
        turn, shift = camera.view[:3, :3], camera.view[:3, 3]
        at = position @ turn.T + shift
        tilt = normal @ turn.T
        depth = np.maximum(-at[..., 2], 1e-30)
        flat = camera.is_orthographic
        sx, sy, ox, oy = camera.pixel_to_view
        k = np.ones_like(depth) if flat else depth
        column = np.clip((at[..., 0] / k - ox) / sx, 0.0, camera.width)
        row = np.clip((at[..., 1] / k - oy) / sy, 0.0, camera.height)
        # Nearness is linear in the texel on every plane; greater is nearer.
        own = -depth if flat else 1.0 / depth
        view_x, view_y = (np.zeros_like(column),) * 2 if flat else (sx * column + ox, sy * row + oy)
        length = np.sqrt(view_x**2 + view_y**2 + 1.0)
        slope = tilt[..., 0] * view_x + tilt[..., 1] * view_y - tilt[..., 2]
        slope = np.minimum(slope, -LEAST_N_DOT_V * length)
        change = (1.0 if flat else own) / slope
        slope_x, slope_y = tilt[..., 0] * sx * change, tilt[..., 1] * sy * change
        texel = max(abs(sx), abs(sy)) * (np.ones_like(own) if flat else own)
        slack = part * (SLOPE * (np.abs(slope_x) + np.abs(slope_y)) + LEAST * texel)
        slack = slack + ROUNDING * np.abs(own)
        nearness = -seen if flat else 1.0 / seen
        return cls(column, row, own, slope_x, slope_y, slack, texel, nearness)

    def limit(self, dx: Doubles, dy: Doubles) -> Doubles:
        """Return the nearness from which on a texel, so many texels off, hides light."""
        rise = np.maximum(dx * self.slope_x + dy * self.slope_y, 0.0)
        away = STEP * self.texel * (np.abs(dx) + np.abs(dy))
        result: Doubles = self.own + rise + self.slack + away
        return result


def soft_face_shadow_reference(
    camera: Camera, seen: Doubles, position: Doubles, normal: Doubles, extent: float
) -> Doubles:
    """Return the share of a light of some size by one image of a map.

    Args:
        camera, seen, position, normal: as for `face_shadow_reference`.
        extent: the light's radius, or the tangent of a directional light's angle.
    """
    at = MapReceiver.of(camera, seen, position, normal)
    sx = camera.pixel_to_view[0]
    spread = extent / abs(sx)
    nearest = 1e30 if camera.is_orthographic else at.own * (SOFT_NEAREST - 1.0)
    reach = np.clip(spread * nearest, SOFT_LEAST, SOFT_FARTHEST)
    turn = np.pi * (3.0 - math.sqrt(5.0))

    def texel(x: Doubles, y: Doubles) -> Doubles:
        columns = np.clip(x.astype(int), 0, camera.width - 1)
        shown: Doubles = at.nearness[np.clip(y.astype(int), 0, camera.height - 1), columns]
        return shown

    found, total = np.zeros_like(at.own), np.zeros_like(at.own)
    for i in range(SOFT_SEARCH):
        part = (i + 0.5) / SOFT_SEARCH
        x = np.floor(at.column + reach * part**2 * math.cos(turn * i))
        y = np.floor(at.row + reach * part**2 * math.sin(turn * i))
        dx, dy = x + 0.5 - at.column, y + 0.5 - at.row
        shown = texel(x, y)
        wide = np.maximum(spread * (shown - at.own), SOFT_LEAST)
        hides = (shown > at.limit(dx, dy)) & (np.hypot(dx, dy) <= wide)
        found += np.where(hides, part**3, 0.0)
        total += np.where(hides, part**3 * (shown - at.own), 0.0)
    width = np.clip(spread * total / np.maximum(found, 1e-9), SOFT_LEAST, SOFT_FARTHEST)
    blocked = np.zeros_like(at.own)
    for i in range(SOFT_TAPS):
        angle = turn * (SOFT_SEARCH + i)
        off = width * math.sqrt((i + 0.5) / SOFT_TAPS)
        px, py = at.column + off * math.cos(angle), at.row + off * math.sin(angle)
        left, top = np.floor(px - 0.5), np.floor(py - 0.5)
        for j in range(2):
            for k in range(2):
                x, y = left + k, top + j
                weight = np.abs(1.0 - k - (px - 0.5 - left)) * np.abs(1.0 - j - (py - 0.5 - top))
                nearer = texel(x, y) > at.limit(x + 0.5 - at.column, y + 0.5 - at.row)
                blocked += np.where(nearer, weight, 0.0)
    result: Doubles = np.where(found > 0.0, np.maximum(1.0 - blocked / SOFT_TAPS, 0.0), 1.0)
    return result
