"""A scene as the rasteriser and the ray caster want it: triangles, materials, textures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.digits import place_text
from ssgi_cl.core.immutable import Immutable, frozen
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene_camera import SceneCamera
from ssgi_cl.core.srgb import mean_color

MOST_TEXELS = 2**29 - 1
"""Of all textures of a scene with their mip levels: their bytes are counted in 31 bits."""


WRAPS = ("repeat", "clamp", "mirror")
"""What a texture is beyond its edges: itself again, its edge, or itself turned round."""

Wrap = tuple[str, str]


@dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """The material of a surface.

    Attributes:
        albedo: [3] linear reflectance in [0, 1]; multiplies the texture and the vertex colour.
        texture: index into `Scene.textures`, or -1.
        alpha_cutoff: where the texture's alpha times `alpha` is below it, there is a hole;
            0 for a surface without holes.
        alpha: opacity factor in [0, 1], used where there are holes or `blends`.
        emission: [3] radiance in W m^-2 sr^-1, in [0, 1e30]; multiplies the texture of emission.
        emission_texture: index into `Scene.textures`, or -1; at the same coordinates as `texture`.
        specular: [3] reflectance of the Phong lobe in [0, 1]; where albedo and it are more than 1
            together, it counts as what the albedo leaves.
        gloss: exponent of the Phong lobe, in [1, 1e6].
        name: of the material in its file; without effect.
        blends: whether only `alpha` times the texture's alpha of the surface is there, in whole
            frames and `truth.radiance`: the rest of the light passes (Porter and Duff 1984).
            G-buffers, and what blocks light from others, are as with `alpha_cutoff`.
        transmission: [3] share of light in [0, 1] that passes straight through what is there, as
            through thin glass; where albedo, specular and it are more than 1 together, it counts as
            what the others leave.
        double_sided: whether its back is there. Otherwise a camera, and a light or a sky, sees what is
            behind its triangles where they turn their back on it, and so do rays that look for
            surfaces; it emits to its front alone (glTF 2.0, 3.9.6).
    """

    name: str = ""
    albedo: tuple[float, float, float] = (0.8, 0.8, 0.8)
    texture: int = -1
    alpha_cutoff: float = 0.0
    alpha: float = 1.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gloss: float = 1.0
    blends: bool = False
    transmission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    double_sided: bool = True
    emission_texture: int = -1

    def __post_init__(self) -> None:
        for name, high in (("albedo", 1.0), ("emission", checks.MOST_LIGHT), ("specular", 1.0), ("transmission", 1.0)):
            unit = "W m^-2 sr^-1" if name == "emission" else ""
            values = checks.rgb(name, getattr(self, name), unit, high=high)
            object.__setattr__(self, name, tuple(float(v) for v in values))
        checks.number("alpha_cutoff", self.alpha_cutoff, low=0, high=1)
        checks.number("alpha", self.alpha, low=0, high=1)
        checks.number("gloss", self.gloss, low=1, high=1e6)
        checks.switch("blends", self.blends)
        checks.switch("double_sided", self.double_sided)

    @property
    def has_holes(self) -> bool:
        """Whether the alpha of its texture cuts out holes."""
        return self.texture >= 0 and self.alpha_cutoff > 0.0

    @property
    def is_hole(self) -> bool:
        """Whether all of it is cut out: it has no texture, and its alpha is below the cutoff."""
        return self.texture < 0 and self.alpha < self.alpha_cutoff

    @property
    def is_glossy(self) -> bool:
        """Whether it has a lobe."""
        return any(self.specular)

    @property
    def spread(self) -> tuple[float, float, float]:
        """[3] share of light from all sides that the lobe reflects above the surface.

        The part of the lobe within `da` of an angle a from its axis is (n + 1) cos^n a sin a da, of which
        (1 + cos a) / 2 lies above the surface, in the mean over all axes by cosine. What lies below it is
        lost.
        """
        share = 1.0 - 0.5 / (self.gloss + 2.0)
        red, green, blue = (share * value for value in self.specular)
        return red, green, blue

    @property
    def transmitted(self) -> tuple[float, float, float]:
        """[3] share of light that passes through what is there."""
        matt, mirrored = np.array(self.albedo), np.array(self.specular)
        left = np.maximum(1.0 - matt - np.minimum(mirrored, 1.0 - matt), 0.0)
        red, green, blue = np.minimum(self.transmission, left).tolist()
        return red, green, blue

    @property
    def is_seen_through(self) -> bool:
        """Whether whole frames show what is behind it."""
        return self.blends or any(self.transmission)

    @property
    def emits(self) -> bool:
        """Whether it emits light."""
        return any(self.emission)


_MOST_NOTES = 6
"""Of a scene, in its text."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Scene(Immutable):
    """Triangles in world space with what is needed to shade them.

    Arrays are read-only, since devices and ray casters keep what they made of them: a changed scene
    is another one, such as `dataclasses.replace(scene, positions=scene.positions * 2)`.

    Attributes:
        origin: [3] float64, world space; `positions` count from here, so that a scene far from
            the world's origin keeps its precision.
        positions: [vertices, 3] float32, scene units, relative to `origin`.
        normals: [vertices, 3] float32, world space, unit length, as the mesh gives them.
        uvs: [vertices, 2] float32, texture coordinates, v = 0 at the bottom row.
        colors: [vertices, 3] float32, linear vertex colour that multiplies the albedo.
        triangles: [triangles, 3] int32 indices of vertices, counter-clockwise seen from outside.
        material_ids: [triangles] int32 indices into `materials`.
        materials: at least one.
        wraps: (across, down) of each texture, what it is beyond its edges: "repeat", "clamp" or "mirror"; by
            default all repeat.
        textures: [rows, columns, 4] uint8 each, RGB in sRGB encoding and linear alpha; row 0 on
            top. With their mip levels at most 2^29 - 1 texels in all.
        lights: those that the file describes; functions take lights as an argument of their own.
        cameras: name -> camera of the file; `cameras[name].sized(width, height)` is a `Camera`.
        notes: lines on what the file says that is not drawn, or drawn in another way.
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
    wraps: tuple[Wrap, ...] = ()
    lights: tuple[Light, ...] = ()
    cameras: Mapping[str, SceneCamera] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        extent = float(np.linalg.norm(np.ptp(self.bounds, axis=0)))
        low, high = (place_text(corner, extent, ", ") for corner in self.bounds)
        notes = [f"note: {note}" for note in self.notes[:_MOST_NOTES]]
        if len(self.notes) > _MOST_NOTES:
            notes.append(f"and {len(self.notes) - _MOST_NOTES} more notes")
        head = (
            f"Scene of {len(self.triangles):,} triangles, {len(self.positions):,} vertices, {len(self.materials)} "
            f"materials, {len(self.textures)} textures, {len(self.lights)} lights, {len(self.cameras)} cameras, from "
            f"({low}) to ({high})"
        )
        return "\n  ".join([head, *notes])

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "origin", frozen(checks.point("origin", self.origin)))
        for name, width in (("positions", 3), ("normals", 3), ("uvs", 2), ("colors", 3)):
            given = getattr(self, name)
            set_(self, name, frozen(checks.plane_list(name, given, width), given))
            if len(getattr(self, name)) != len(self.positions):
                raise ValueError(
                    f"{name} has {len(getattr(self, name))} rows: expected {len(self.positions)}, one for each vertex"
                )
        triangles = np.ascontiguousarray(checks.as_array("triangles", self.triangles))
        if triangles.dtype.kind not in "iu" or triangles.ndim != 2 or triangles.shape[1] != 3:
            raise ValueError(
                f"triangles is {triangles.dtype} {triangles.shape}: expected integers of shape (triangles, 3)"
            )
        if len(triangles) == 0:
            raise ValueError("the scene has 0 triangles: expected at least one")
        if triangles.min() < 0 or triangles.max() >= len(self.positions):
            raise ValueError(
                f"triangles refers to vertices {triangles.min()} to {triangles.max()}: expected "
                f"0 to {len(self.positions) - 1}"
            )
        set_(self, "triangles", frozen(triangles.astype(np.int32), triangles))
        ids = np.ascontiguousarray(checks.as_array("material_ids", self.material_ids))
        if ids.shape != (len(triangles),) or ids.dtype.kind not in "iu":
            raise ValueError(f"material_ids is {ids.dtype} {ids.shape}: expected {len(triangles)} integers")
        if not self.materials:
            raise ValueError("materials is empty: expected at least one")
        if ids.min() < 0 or ids.max() >= len(self.materials):
            raise ValueError(
                f"material_ids runs from {ids.min()} to {ids.max()}: expected 0 to {len(self.materials) - 1}"
            )
        set_(self, "material_ids", frozen(ids.astype(np.int32), ids))
        set_(self, "materials", tuple(self.materials))
        set_(self, "textures", _textures(self.textures))
        set_(self, "wraps", _wraps(self.wraps, len(self.textures)))
        set_(self, "lights", tuple(self.lights))
        set_(self, "cameras", dict(self.cameras))
        set_(self, "notes", tuple(self.notes))
        for material in self.materials:
            for name in ("texture", "emission_texture"):
                checks.integer(name, getattr(material, name), low=-1, high=len(self.textures) - 1)

    @cached_property
    def key(self) -> object:
        """An object that tells the scene from others without keeping it."""
        return object()

    @cached_property
    def used_materials(self) -> tuple[Material, ...]:
        """Those that any triangle is made of."""
        return tuple(self.materials[index] for index in np.unique(self.material_ids))

    @cached_property
    def is_seen_through(self) -> bool:
        """Whether whole frames show what is behind some of it, see `ssgi_cl.core.scene_parts`."""
        return any(material.is_seen_through for material in self.used_materials)

    @cached_property
    def has_holes(self) -> bool:
        """Whether a texture's alpha cuts holes into any triangle."""
        return any(material.has_holes for material in self.used_materials)

    @cached_property
    def emits_by_texture(self) -> bool:
        """Whether any material's emission has a texture."""
        return any(material.emits and material.emission_texture >= 0 for material in self.used_materials)

    @cached_property
    def culled_backs(self) -> NDArray[np.bool_]:
        """[triangles] whether the back of each is not there, see `Material.double_sided`."""
        return np.array([not material.double_sided for material in self.materials])[self.material_ids]

    @cached_property
    def cut_out(self) -> NDArray[np.bool_]:
        """[triangles] whether a texture's alpha cuts holes into each."""
        return np.array([material.has_holes for material in self.materials])[self.material_ids]

    @cached_property
    def culls(self) -> bool:
        """Whether the back of any triangle is not there."""
        return bool(self.culled_backs.any())

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """[2, 3] float64, world space: least and greatest corner of the box round all triangles."""
        used = np.zeros(len(self.positions), np.bool_)
        used[self.triangles] = True
        columns = [column[used] for column in self.positions.T]  # numpy is slow on rows of three numbers
        box = np.array([[end(column) for column in columns] for end in (np.min, np.max)]) + self.origin
        box.flags.writeable = False
        return box


def _textures(given: Sequence[NDArray[np.uint8]]) -> tuple[NDArray[np.uint8], ...]:
    arrays = [checks.as_array(f"textures[{index}]", one) for index, one in enumerate(given)]
    for index, array in enumerate(arrays):
        if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 4 or not array.size:
            raise ValueError(f"textures[{index}] is {array.dtype} {array.shape}: expected uint8 (rows, columns, 4)")
    texels = sum(mip_texels(*array.shape[:2]) for array in arrays)
    if texels > MOST_TEXELS:
        raise ValueError(f"textures have {texels} texels with their mip levels: expected at most {MOST_TEXELS}")
    return tuple(map(frozen, arrays, given))


def _wraps(given: Sequence[Wrap], count: int) -> tuple[Wrap, ...]:
    wraps = tuple(given) or ((WRAPS[0], WRAPS[0]),) * count
    if len(wraps) != count:
        raise ValueError(f"wraps has {len(wraps)} entries: expected {count}, one for each texture")
    for index, (across, down) in enumerate(wraps):
        for kind in (across, down):
            checks.choice(f"wraps[{index}]", kind, WRAPS)
    return wraps


def wrapped(coordinate: NDArray[np.float64], kind: str) -> NDArray[np.float64]:
    """Return texture coordinates brought into [0, 1] as `kind` of `WRAPS` says."""
    if kind == "clamp":
        return np.clip(coordinate, 0.0, 1.0)
    if kind == "mirror":
        twice = np.mod(coordinate, 2.0)
        return np.minimum(twice, 2.0 - twice)
    return np.mod(coordinate, 1.0)


def mean_emission(scene: Scene, material: Material) -> NDArray[np.float64]:
    """Return the radiance [3] of a material, that of its texture's mean if it has one."""
    radiance = np.array(material.emission, np.float64)
    if material.emits and material.emission_texture >= 0:
        radiance *= mean_color(scene.textures[material.emission_texture])
    return radiance


def mip_texels(rows: int, columns: int) -> int:
    """Return the number of texels of all mip levels of a texture."""
    count = rows * columns
    while max(rows, columns) > 1:
        rows, columns = (rows + 1) // 2, (columns + 1) // 2
        count += rows * columns
    return count


def box_corners(bounds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners [8, 3] of a box given as `Scene.bounds` [2, 3]."""
    return np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
