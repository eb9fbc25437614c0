"""Specular reflection by Phong lobes, in float64 (Phong 1975, normalised as in Lewis 1994)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, PointLight, SpotLight
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView, view_normals


@dataclass(frozen=True, eq=False)
class Lobes:
    """The lobes of pixels.

    Attributes:
        specular: [rows, columns, 3] reflectance, of which albedo and it are at most 1.
        gloss: [rows, columns] exponent.
        axis: [rows, columns, 3] the mirrored view ray, world space, unit length.
        bend: [rows, columns] squared change of the normal to the next pixel along rows, the lesser
            of the two, and that along columns.
    """

    specular: Doubles
    gloss: Doubles
    axis: Doubles
    bend: Doubles

    @classmethod
    def of(cls, gbuffer: GBuffer, position: Doubles, normal: Doubles) -> Self:
        """Return those of a G-buffer; position and normal [rows, columns, 3] in world space."""
        camera = gbuffer.camera
        if camera.is_orthographic:
            view = np.broadcast_to(-camera.view[2, :3], position.shape)
        else:
            away = position - camera.position
            view = away / np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-300)
        along = np.sum(view * normal, axis=-1, keepdims=True)
        given = gbuffer.first("albedo")
        size = (*gbuffer.size, 3)
        albedo = np.full(size, 0.8) if given is None else gbuffer.inner(given).astype(np.float64)
        specular, gloss = gbuffer.first("specular"), gbuffer.first("gloss")
        if specular is None or gloss is None:
            raise ValueError("the G-buffer has no specular and gloss: expected both")
        own = np.clip(gbuffer.inner(specular).astype(np.float64), 0.0, 1.0 - albedo)
        normals = view_normals(SurfaceView.of(gbuffer), gbuffer.first("normal"))
        bend = _bend(normals, 0) + _bend(normals, 1)
        rows, columns = gbuffer.margin
        inner = bend[rows : bend.shape[0] - rows, columns : bend.shape[1] - columns]
        return cls(own, np.clip(gbuffer.inner(gloss), 1.0, 1e6).astype(np.float64), view - 2.0 * along * normal, inner)

    @property
    def above(self) -> Doubles:
        """[rows, columns] the part of a lobe above its surface, in the mean over axes by cosine."""
        result: Doubles = (2.0 * self.gloss + 3.0) / (2.0 * self.gloss + 4.0)
        return result

    def widened(self) -> Self:
        """Return lobes as wide as what a pixel of a bent surface mirrors.

        A lobe's variance is 1 / n; that of mirrored rays is 4 times that of normals, which is 1/12
        of the squared change to the next pixel (after Kaplanyan et al. 2016).
        """
        variance = 1.0 / self.gloss + 4.0 / 12.0 * self.bend / 2.0
        return replace(self, gloss=np.maximum(1.0 / variance, 1.0))

    def value(self, way: Doubles) -> Doubles:
        """Return the lobe in directions [rows, columns, 3] of unit length, per solid angle."""
        cosine = np.clip(np.sum(self.axis * way, axis=-1), 0.0, 1.0)
        result: Doubles = (self.gloss + 1.0) / (2.0 * np.pi) * cosine**self.gloss
        return result

    def reflected(
        self, light: SpotLight | PointLight | DirectionalLight, position: Doubles, normal: Doubles
    ) -> Doubles:
        """Return radiance [rows, columns, 3] of a light that nothing hides."""
        if isinstance(light, DirectionalLight):
            way = np.broadcast_to(-np.asarray(light.direction), position.shape)
            strength, power = np.ones(position.shape[:-1]), np.asarray(light.irradiance)
        else:
            to_light = np.asarray(light.position) - position
            distance = np.linalg.norm(to_light, axis=-1)
            safe = np.where(distance > 0.0, distance, 1.0)
            way, strength = to_light / safe[..., None], 1.0 / safe**2
            power = np.asarray(light.intensity)
            if isinstance(light, SpotLight):
                along = -way @ np.asarray(light.direction)
                strength = np.where(along >= np.cos(light.cone_angle), strength, 0.0)
        strength = np.where(np.sum(way * normal, axis=-1) > 0.0, strength, 0.0)
        result: Doubles = self.specular * (strength * self.value(way))[..., None] * power
        return result


def _bend(normal: Doubles, axis: int) -> Doubles:
    """Return squared change of normals [rows, columns, 3] along an axis, the lesser of the two."""
    step = np.diff(normal, axis=axis)
    squared = np.sum(step * step, axis=-1)
    end = [(0, 0), (0, 0)]
    end[axis] = (1, 1)
    both = np.pad(squared, end, constant_values=np.inf)
    count = normal.shape[axis]
    least = np.minimum(*(np.take(both, range(k, k + count), axis) for k in (0, 1)))
    result: Doubles = np.where(np.isfinite(least), least, 0.0)
    return result
