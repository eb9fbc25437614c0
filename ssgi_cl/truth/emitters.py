"""Emissive triangles as light sources: which one a sample is drawn from, and how probably."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Scene

Doubles = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Emitters:
    """The emissive triangles of a scene that samples are drawn from.

    A triangle is chosen by area times mean radiance, so that the density of a point is
    proportional to its radiance. Surfaces with alpha cut-outs, with a texture of emission, and such as
    are seen through, are left out, as a sample may fall into a hole: paths find those by themselves.

    Attributes:
        corner, first, second: [m, 3] float64, a corner relative to the scene's origin, and the
            edges that leave it, scene units.
        radiance: [m, 3], W m^-2 sr^-1.
        cumulative: [m], probability of this triangle or one before it.
        density: [m], of a point on each triangle, per area.
        material_density: [materials], the same on surfaces of each material; 0 where none is
            drawn.
        backless: [m], whether the back is not there and does not emit.
    """

    corner: Doubles
    first: Doubles
    second: Doubles
    radiance: Doubles
    cumulative: Doubles
    density: Doubles
    material_density: Doubles
    backless: NDArray[np.bool_]

    @classmethod
    def of(cls, scene: Scene) -> Emitters:
        """Collect those of a scene; none may be there."""
        emission = np.array([m.emission for m in scene.materials])
        brightness = emission.mean(axis=1)
        sampled = [not m.has_holes and not m.is_seen_through and m.emission_texture < 0 for m in scene.materials]
        brightness = np.where(sampled, brightness, 0.0)
        chosen = np.flatnonzero(brightness[scene.material_ids] > 0.0)
        corners = scene.positions[scene.triangles[chosen]].astype(np.float64)
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = 0.5 * np.linalg.norm(np.cross(first, second), axis=-1)
        chosen, corners, first, second = (a[area > 0.0] for a in (chosen, corners, first, second))
        material = scene.material_ids[chosen]
        flux = area[area > 0.0] * brightness[material]
        total = max(float(flux.sum()), 1e-300)
        density = brightness / total if len(chosen) else np.zeros(len(brightness))
        backless = np.array([not m.double_sided for m in scene.materials])[material]
        return cls(
            corners[:, 0],
            first,
            second,
            emission[material],
            np.cumsum(flux) / total,
            density[material],
            density,
            backless,
        )

    def __len__(self) -> int:
        return len(self.corner)
