"""A scene as the rasteriser and the ray caster want it: triangles, materials, textures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ssgi_cl import check


@dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """What a surface is made of.

    Attributes:
        albedo: [3] linear reflectance in [0, 1]; multiplies the texture and the vertex colour.
        texture: index into `Scene.textures`, or -1.
        alpha_cutoff: where the texture's alpha times `alpha` is below it, there is a hole;
            0 for an opaque surface.
        alpha: opacity factor in [0, 1], used for the cut-out only.
        emission: [3] radiance in W m^-2 sr^-1, >= 0.
        specular: [3] reflectance of the Phong lobe in [0, 1].
        gloss: exponent of the Phong lobe, >= 1.
    """

    name: str = ""
    albedo: tuple[float, float, float] = (0.8, 0.8, 0.8)
    texture: int = -1
    alpha_cutoff: float = 0.0
    alpha: float = 1.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gloss: float = 1.0

    def __post_init__(self) -> None:
        for name, high in (("albedo", 1.0), ("emission", math.inf), ("specular", 1.0)):
            values = check.rgb(name, getattr(self, name), "")
            if (values > high).any():
                raise ValueError(f"{name} is {values.tolist()}: expected numbers in [0, {high:g}]")
            object.__setattr__(self, name, tuple(float(v) for v in values))
        check.number("alpha_cutoff", self.alpha_cutoff, low=0, high=1)
        check.number("alpha", self.alpha, low=0, high=1)
        check.number("gloss", self.gloss, low=1, high=1e6)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scene:
    """Triangles in world space with what is needed to shade them.

    Attributes:
        origin: [3] float64, world space; `positions` count from here, so that a scene far from
            the world's origin keeps its precision.
        positions: [vertices, 3] float32, scene units, relative to `origin`.
        normals: [vertices, 3] float32, world space, unit length, as the mesh gives them.
        uvs: [vertices, 2] float32, texture coordinates, v = 0 at the bottom row, repeated.
        colors: [vertices, 3] float32, linear vertex colour that multiplies the albedo.
        triangles: [triangles, 3] int32 indices of vertices, counter-clockwise seen from outside.
        material_ids: [triangles] int32 indices into `materials`.
        materials: at least one.
        textures: [rows, columns, 4] uint8 each, RGB in sRGB encoding and linear alpha; row 0 on
            top.
    """

    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    uvs: NDArray[np.float32]
    colors: NDArray[np.float32]
    triangles: NDArray[np.int32]
    material_ids: NDArray[np.int32]
    materials: tuple[Material, ...] = (Material(),)
    textures: tuple[NDArray[np.uint8], ...] = ()

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "origin", check.vector("origin", self.origin, 3, "scene units"))
        for name, width in (("positions", 3), ("normals", 3), ("uvs", 2), ("colors", 3)):
            set_(self, name, check.plane_list(name, getattr(self, name), width))
            if len(getattr(self, name)) != len(self.positions):
                raise ValueError(
                    f"{name} has {len(getattr(self, name))} rows: expected {len(self.positions)}, "
                    "one for each vertex"
                )
        triangles = np.ascontiguousarray(self.triangles)
        if triangles.dtype.kind not in "iu" or triangles.ndim != 2 or triangles.shape[1] != 3:
            raise ValueError(
                f"triangles is {triangles.dtype} {triangles.shape}: expected integers of shape "
                "(triangles, 3)"
            )
        if len(triangles) == 0:
            raise ValueError("the scene has 0 triangles: expected at least one")
        if triangles.min() < 0 or triangles.max() >= len(self.positions):
            raise ValueError(
                f"triangles refers to vertices {triangles.min()} to {triangles.max()}: expected "
                f"0 to {len(self.positions) - 1}"
            )
        set_(self, "triangles", triangles.astype(np.int32))
        ids = np.ascontiguousarray(self.material_ids)
        if ids.shape != (len(triangles),) or ids.dtype.kind not in "iu":
            raise ValueError(
                f"material_ids is {ids.dtype} {ids.shape}: expected {len(triangles)} integers"
            )
        if not self.materials:
            raise ValueError("materials is empty: expected at least one")
        if ids.min() < 0 or ids.max() >= len(self.materials):
            raise ValueError(
                f"material_ids runs from {ids.min()} to {ids.max()}: expected 0 to "
                f"{len(self.materials) - 1}"
            )
        set_(self, "material_ids", ids.astype(np.int32))
        for material in self.materials:
            check.integer("texture", material.texture, low=-1, high=len(self.textures) - 1)
        for index, texture in enumerate(self.textures):
            fits = texture.dtype == np.uint8 and texture.ndim == 3 and texture.shape[2] == 4
            if not fits or texture.size == 0:
                raise ValueError(
                    f"textures[{index}] is {texture.dtype} {texture.shape}: expected uint8 "
                    "(rows, columns, 4)"
                )

    @cached_property
    def key(self) -> object:
        """What tells the scene from others without keeping it."""
        return object()

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """[2, 3] float64, world space: least and greatest corner of the box round all triangles."""
        used = np.zeros(len(self.positions), np.bool_)
        used[self.triangles] = True
        corners = self.positions[used]
        box = np.stack([corners.min(axis=0), corners.max(axis=0)]) + self.origin
        box.flags.writeable = False
        return box
