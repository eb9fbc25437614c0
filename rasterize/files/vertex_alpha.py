"""Alpha of vertex colours (glTF 2.0, 3.9.4): folded into materials, or into a texture that is a ramp of alpha."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Material
from ssgi_cl.rasterize.files.textures import TextureSet, lets_through
from ssgi_cl.rasterize.parts import Part

LEVELS = 64
"""Steps of alpha that triangles are sorted into whose material has a texture of its own."""

RAMP = np.full((1, 256, 4), 255, np.uint8)
"""White, with alpha from 0 to 1: bilinear between the middles of its texels it is the coordinate itself."""
RAMP[0, :, 3] = np.arange(256)


def with_vertex_alpha(
    part: Part, alpha: NDArray[np.float64], materials: list[Material], textures: TextureSet, *, blends: bool
) -> Part:
    """Return a part of one material whose vertices have opacities too.

    One opacity of all vertices is the material's; several become texture coordinates into a ramp of alpha, which
    is as exact as 8 bits. Beside a texture, each triangle has the mean of its corners, which is noted.

    Args:
        part: all of whose triangles have one material.
        alpha: [vertices] opacity.
        materials: to which materials are added.
        textures: to which the ramp is added.
        blends: whether the material blends with what is behind, by what the file says; else it has holes.
    """
    alpha = np.clip(np.nan_to_num(alpha, nan=1.0), 0.0, 1.0)
    triangles = part.triangles
    if not triangles.size or triangles.min() < 0 or triangles.max() >= len(alpha):
        return part  # which is refused when parts are joined
    corners = alpha[triangles]
    if corners.min() >= 1.0:
        return part
    material = materials[int(part.material_ids[0])]
    if corners.min() == corners.max():
        return _of_levels(part, np.full(len(part.triangles), corners.flat[0]), material, materials, textures, blends)
    if material.texture >= 0:
        textures.note("vertex alpha beside a texture counts with its mean on each triangle")
        levels = np.round(corners.mean(axis=1) * LEVELS) / LEVELS
        return _of_levels(part, levels, material, materials, textures, blends)
    ramp = textures.add(RAMP, ("clamp", "clamp"))
    materials.append(replace(material, texture=ramp, blends=blends))
    uvs = np.column_stack([(255.0 * alpha + 0.5) / 256.0, np.full(len(alpha), 0.5)])
    return replace(part, uvs=uvs, material_ids=np.full(len(part.triangles), len(materials) - 1))


def _of_levels(
    part: Part,
    levels: NDArray[np.float64],
    material: Material,
    materials: list[Material],
    textures: TextureSet,
    blends: bool,
) -> Part:
    """Return a part whose triangles have a material for each opacity of `levels` [triangles]."""
    image = textures.textures[material.texture] if material.texture >= 0 else None
    ids = np.empty(len(levels), np.int64)
    for level in np.unique(levels):
        opacity = material.alpha * float(level)
        materials.append(replace(material, alpha=opacity, blends=blends and lets_through(opacity, image)))
        ids[levels == level] = len(materials) - 1
    return replace(part, material_ids=ids)
