"""Scenes and lights as Mitsuba 3 has them: the same triangles, surfaces and radiometric units."""

from __future__ import annotations

import importlib
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, SpotLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.core.scene_parts import without_holes
from ssgi_cl.core.srgb import BYTES
from ssgi_cl.techniques.direct.light_data import power
from ssgi_cl.truth.emitters import Emitters
from ssgi_cl.truth.mitsuba_textures import bitmap, glow, register_product
from ssgi_cl.truth.phong_bsdf import PHONG, register_phong

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]

OLDEST_LLVM = 17
"""Mitsuba 3.9 refuses LLVM 14, and with 15 and 16 the process ends on CPUs with AVX-512."""

SKY_ROWS = 512
"""Rows of an environment's image, at least: Mitsuba interpolates between them, we don't."""

HOLE = 0.5
"""Opacity in Mitsuba below which there is a hole; opacities are scaled to make it so."""

SIZE = "face_size"
"""Mesh attribute: largest coordinate of a triangle plus its largest extent, scene units."""

BEHIND = 2.0**-16
"""Distance between a triangle that emits and the one turned round behind it, in sizes of both."""

EMISSION = "face_emission"
"""Mesh attribute: radiance of a triangle, W m^-2 sr^-1."""

SPECULAR = "face_specular"
"""Mesh attribute: reflectance of a triangle's lobe."""

GLOSS = "face_gloss"
"""Mesh attribute: Phong exponent of that lobe."""

TRANSMISSION = "face_transmission"
"""Mesh attribute: share of light that passes through what is there of a triangle."""

BLENDS = "face_blends"
"""Mesh attribute: 1 for a triangle whose opacity is a share of its surface, else 0."""

BACKLESS = "face_backless"
"""Mesh attribute, of scenes that cull: 1 for a triangle without a back, else 0."""

GLOW = "emission_texture"
"""Texture attribute, of scenes with textures of emission: what emission is multiplied by."""

DENSITY = "face_emission_density"
"""Mesh attribute: density of a sample at a point of an emissive triangle, per area."""

_FOLDERS = (
    "/usr/lib", "/usr/lib64", "/usr/lib/*-linux-gnu", "/usr/lib/llvm-*/lib", "/usr/local/lib",
    "/opt/homebrew/opt/llvm*/lib",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class MitsubaScene:
    """A scene with its lights in Mitsuba.

    Mitsuba's own integrators take it too, but for cut-outs, where they make opacity a probability,
    and for backs that are not there, which they see.
    Emission of surfaces is left out unless asked for: light comes from lights alone.

    Attributes:
        variant: of Mitsuba; the scene is of use only `within` it.
        origin: [3] float64, world space: Mitsuba's coordinates count from here.
        scene: the `mitsuba.Scene`. Its shapes have the attribute `SIZE`.
        has_holes: whether a texture's alpha cuts something out.
        blends: whether something is seen through, and asked for.
        culls: whether shapes have the attribute `BACKLESS`.
        glows: whether shapes have the attribute `GLOW`.
        has_sky_image: whether the environment is an image.
    """

    variant: str
    origin: Doubles
    scene: Any
    has_holes: bool
    blends: bool
    culls: bool
    glows: bool
    has_sky_image: bool

    @classmethod
    def of(
        cls,
        scene: Scene,
        lights: Sequence[Light],
        variant: str,
        *,
        emission: str = "none",
        lobes: str = "none",
        through: str = "none",
    ) -> MitsubaScene:
        """Bring a scene and those lights that shine into a variant of Mitsuba.

        Args:
            emission: what becomes of that of materials: "none", "attributes" for the attributes
                `EMISSION` and `DENSITY` of shapes, or "emitters" for emitters of Mitsuba's own,
                which shine to the front of a triangle only: so there is a second triangle behind
                each, turned round.
            lobes: what becomes of the Phong lobes of materials: "none", "attributes" for the
                attributes `SPECULAR` and `GLOSS` of shapes, or "surfaces" for a BSDF of ours.
            through: what becomes of surfaces that are seen through: "none" cuts them out where
                `Material.alpha_cutoff` says so; "attributes" keeps their opacity as a mask, with
                the attributes `BLENDS` and `TRANSMISSION` of shapes; "surfaces" makes one mask of
                both, without colour, for Mitsuba's own integrators.
        """
        scene = without_holes(scene) if through == "none" else scene
        blends = through != "none" and scene.is_seen_through
        emitters = Emitters.of(scene) if emission == "attributes" else None
        with within(variant) as mi:
            parts: dict[str, Any] = {"type": "scene"}
            for index in np.unique(scene.material_ids):
                emits = emission == "emitters" and any(scene.materials[index].emission)
                if emits:
                    back = _turned_round(scene, int(index))
                    parts[f"back_{index}"] = _mesh(
                        mi, back, int(index), emits=True, glossy=lobes == "surfaces", through=through
                    )
                mesh = _mesh(mi, scene, int(index), emits=emits, glossy=lobes == "surfaces", through=through)
                material, values = scene.materials[index], dict[str, Any]()
                if emitters is not None:
                    values |= {EMISSION: material.emission, DENSITY: emitters.material_density[index]}
                if lobes == "attributes":
                    values |= {SPECULAR: material.specular, GLOSS: material.gloss}
                if blends and through == "attributes":
                    values |= {TRANSMISSION: material.transmitted, BLENDS: material.blends}
                if scene.culls:
                    values |= {BACKLESS: not material.double_sided}
                count = int(np.count_nonzero(scene.material_ids == index))
                for name, value in values.items():
                    each = np.atleast_1d(np.asarray(value, np.float32))
                    mesh.add_attribute(name, len(each), np.tile(each, count))
                if emission == "attributes" and scene.emits_by_texture:
                    mesh.add_texture_attribute(GLOW, mi.load_dict(glow(mi, scene, material)))
                parts[f"material_{index}"] = mesh
            for index, light in enumerate(lights):
                if not isinstance(light, Environment) and power(light).any():
                    parts[f"light_{index}"] = _punctual_light(mi, light, scene.origin)
            skies = [np.asarray(e.radiance) for e in lights if isinstance(e, Environment)]
            skies = [sky for sky in skies if sky.any()]
            if skies:
                parts["environment"] = _environment(mi, skies)
            return cls(
                variant,
                scene.origin,
                mi.load_dict(parts),
                any(m.has_holes for m in scene.used_materials),
                blends,
                scene.culls,
                emission == "attributes" and scene.emits_by_texture,
                any(sky.ndim == 3 for sky in skies),
            )


def sensor(mi: Any, world: MitsubaScene, camera: Camera) -> dict[str, Any]:
    """Return what makes Mitsuba's sensor of a perspective camera that looks along its axis.

    Pixels are box-filtered.

    Raises:
        ValueError: the camera is orthographic or off-centre.
    """
    matrix = camera.projection
    if camera.is_orthographic or matrix[0, 2] or matrix[1, 2]:
        raise ValueError("camera is orthographic or off-centre: expected a centred perspective")
    eye = camera.position - world.origin
    rotation = camera.view[:3, :3]
    # Mitsuba's clip planes are a ratio apart that float32 can hold.
    near = max(camera.near, 1e-6)
    return {
        "type": "perspective",
        "fov_axis": "y",
        "fov": float(2.0 * np.degrees(np.arctan(1.0 / matrix[1, 1]))),
        "near_clip": near,
        "far_clip": min(camera.far, 1e8 * near),
        "to_world": mi.ScalarTransform4f().look_at(eye.tolist(), (eye - rotation[2]).tolist(), rotation[1].tolist()),
        "film": {
            "type": "hdrfilm",
            "width": camera.width,
            "height": camera.height,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
    }


@contextmanager
def within(variant: str) -> Iterator[Any]:
    """Give the package `mitsuba` while a variant is set; afterwards that of before is set again."""
    mi = mitsuba()
    before = mi.variant()
    mi.set_variant(variant)
    try:
        yield mi
    finally:
        if before is not None:
            mi.set_variant(before)


def mitsuba() -> Any:
    """Return the package.

    Raises:
        MissingExtraError: it is not installed; it comes with the extra `truth`.
    """
    path = libllvm()
    if path is not None:
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", path)  # read when its back end starts
    try:
        return importlib.import_module("mitsuba")
    except ImportError as error:
        raise MissingExtraError(
            "light by path tracing needs mitsuba, which is not installed: pip install 'ssgi-cl[truth]'"
        ) from error


@cache
def best_variant() -> str:
    """Return "llvm_ad_rgb" where it runs, otherwise "scalar_rgb", which is far slower."""
    mitsuba()
    drjit = importlib.import_module("drjit")
    usable = libllvm() is not None and drjit.has_backend(drjit.JitBackend.LLVM)
    return "llvm_ad_rgb" if usable else "scalar_rgb"


def libllvm() -> str | None:
    """Return DRJIT_LIBLLVM_PATH if set, otherwise the newest libLLVM that is new enough."""
    given = os.environ.get("DRJIT_LIBLLVM_PATH")
    if given:
        return given
    found = []
    for folder in _FOLDERS:
        for path in Path("/").glob(f"{folder[1:]}/libLLVM*"):
            version = re.match(r"libLLVM[-.](?:so\.)?(\d+)", path.name)
            if version and int(version[1]) >= OLDEST_LLVM:
                found.append((int(version[1]), str(path)))
    return max(found)[1] if found else None


def _mesh(mi: Any, scene: Scene, index: int, *, emits: bool, glossy: bool, through: str) -> Any:
    """Return the triangles of one material, as an emitter if it is to emit, with its lobe if
    `glossy`; for `through` see `MitsubaScene.of`."""
    material = own = scene.materials[index]
    if through == "surfaces":
        material = _masked(own)
    chosen = scene.triangles[scene.material_ids == index]
    used, numbers = np.unique(chosen, return_inverse=True)
    corners = scene.positions[chosen]
    colors = np.clip(scene.colors[used] * np.asarray(material.albedo, np.float32), 0.0, 1.0)
    uniform = bool((colors == colors[0]).all())
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(
        _surface(
            mi,
            scene,
            material,
            colors[0] if uniform else None,
            glossy=glossy,
            masks=through != "none" and material.blends,
            textured_mask=own.blends,
        )
    )
    if emits:
        radiance: dict[str, Any] = {"type": "rgb", "value": list(material.emission)}
        if material.emission_texture >= 0:
            radiance = glow(mi, scene, material, np.array(material.emission))
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
    normals = scene.normals[used]
    mesh = mi.Mesh(
        f"material {index}",
        len(used),
        len(chosen),
        properties,
        has_vertex_normals=bool(normals.any()),
        has_vertex_texcoords=True,
    )
    values = mi.traverse(mesh)
    values["vertex_positions"] = scene.positions[used].ravel()
    values["faces"] = numbers.astype(np.uint32).ravel()
    values["vertex_texcoords"] = scene.uvs[used].ravel()
    values.update()
    if normals.any():
        # After the positions, whose change makes Mitsuba replace normals by its own.
        values["vertex_normals"] = normals.ravel()
        values.update()
    size = np.abs(corners).max(axis=(1, 2)) + np.ptp(corners, axis=1).max(axis=1)
    mesh.add_attribute(SIZE, 1, size.astype(np.float32))
    if not uniform:
        mesh.add_attribute("vertex_color", 3, colors.ravel())
    return mesh


def _masked(material: Material) -> Material:
    """Return a material that lets as much light through by its opacity, without colour."""
    if not any(material.transmission):
        return material
    stopped = max(1.0 - float(np.mean(material.transmitted)), 1e-6)
    shares = [np.minimum(np.array(c) / stopped, 1.0) for c in (material.albedo, material.specular)]
    albedo, specular = ((float(r), float(g), float(b)) for r, g, b in shares)
    return replace(
        material,
        blends=True,
        alpha=(material.alpha if material.blends else 1.0) * stopped,
        transmission=(0.0, 0.0, 0.0),
        albedo=albedo,
        specular=specular,
    )


def _turned_round(scene: Scene, index: int) -> Scene:
    """Return the triangles of one material turned round, behind where they were."""
    chosen = scene.triangles[scene.material_ids == index]
    corners = scene.positions[chosen].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-300)
    size = np.abs(corners).max(axis=(1, 2)) + np.ptp(corners, axis=1).max(axis=1)
    corners -= (normal * (BEHIND * size)[:, None])[:, None]
    vertices = chosen.ravel()
    return replace(
        scene,
        positions=corners.reshape(-1, 3).astype(np.float32),
        normals=-scene.normals[vertices],
        uvs=scene.uvs[vertices],
        colors=scene.colors[vertices],
        triangles=np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)[:, ::-1],
        material_ids=np.full(len(chosen), index, np.int32),
    )


def _surface(
    mi: Any, scene: Scene, material: Material, color: Floats | None, *, glossy: bool, masks: bool, textured_mask: bool
) -> dict[str, Any]:
    """Return the BSDF of a material; with no `color` the mesh has an attribute of that name.

    `masks`: it has its opacity; `textured_mask`: which the texture's alpha is a factor of.
    """
    reflectance: dict[str, Any] = {"type": "mesh_attribute", "name": "vertex_color"}
    if color is not None:
        reflectance = {"type": "rgb", "value": color.tolist()}
    if material.texture >= 0:
        texels, wrap = scene.textures[material.texture], scene.wraps[material.texture]
        decoded = BYTES[texels[..., :3]]
        if color is not None:
            reflectance = bitmap(mi, decoded * color, wrap)
        else:
            register_product(mi)
            reflectance = {
                "type": "ssgi_product", "first": bitmap(mi, decoded, wrap), "second": reflectance,
            }  # fmt: skip
    inner: dict[str, Any] = {"type": "diffuse", "reflectance": reflectance}
    if glossy and material.is_glossy:
        register_phong(mi)
        inner = {
            "type": PHONG,
            "reflectance": reflectance,
            "gloss": material.gloss,
            "specular": {"type": "rgb", "value": list(material.specular)},
        }
    surface: dict[str, Any] = {"type": "twosided", "material": inner}
    if masks:
        opacity: dict[str, Any] | float = material.alpha
        if material.texture >= 0 and textured_mask:
            alpha = scene.textures[material.texture][..., 3:] / 255.0
            opacity = bitmap(mi, alpha * material.alpha, scene.wraps[material.texture])
        surface = {"type": "mask", "opacity": opacity, "material": surface}
    elif material.has_holes:
        alpha = scene.textures[material.texture][..., 3:] / 255.0
        scaled = alpha * (material.alpha * HOLE / material.alpha_cutoff)
        surface = {"type": "mask", "opacity": bitmap(mi, scaled, scene.wraps[material.texture]), "material": surface}
    return surface


def _punctual_light(mi: Any, light: Light, origin: Doubles) -> dict[str, Any]:
    """Return an emitter of the same intensity in W/sr or irradiance in W/m^2."""
    if isinstance(light, DirectionalLight):
        return {
            "type": "directional",
            "direction": np.asarray(light.direction).tolist(),
            "irradiance": {"type": "rgb", "value": np.asarray(light.irradiance).tolist()},
        }
    assert not isinstance(light, Environment)  # noqa: S101  the only kind left beside lights
    position = (np.asarray(light.position) - origin).tolist()
    intensity = {"type": "rgb", "value": np.asarray(light.intensity).tolist()}
    if not isinstance(light, SpotLight):
        return {"type": "point", "position": position, "intensity": intensity}
    axis = np.asarray(light.direction)
    up = np.eye(3)[np.abs(axis).argmin()]
    angle = float(np.degrees(light.cone_angle))
    move = mi.ScalarTransform4f().translate(position)
    turn = mi.ScalarTransform4f().look_at([0.0, 0.0, 0.0], axis.tolist(), up.tolist())
    # Without a rim between beam width and cut-off, its edge is as hard as ours.
    return {
        "type": "spot", "to_world": move @ turn, "intensity": intensity,
        "cutoff_angle": angle, "beam_width": angle,
    }  # fmt: skip


def _environment(mi: Any, skies: Sequence[Doubles]) -> dict[str, Any]:
    """Return one emitter for the sum of environments: Mitsuba takes no second one."""
    if all(sky.ndim == 1 for sky in skies):
        radiance = np.sum(skies, axis=0).tolist()
        return {"type": "constant", "radiance": {"type": "rgb", "value": radiance}}
    images = [sky.reshape(1, 1, 3) if sky.ndim == 1 else sky for sky in skies]
    rows = max(SKY_ROWS, *(image.shape[0] for image in images))
    columns = max(2 * SKY_ROWS, *(image.shape[1] for image in images))
    # Mitsuba's row 0 looks up, the last row down; column 0 begins at -z. Each of its texels is
    # the mean over four points of its share of the sphere.
    total = np.zeros((rows + 1, columns, 3))
    for image in images:
        for dv in (-0.25, 0.25):
            for du in (0.25, 0.75):
                v = np.clip((np.arange(rows + 1) + dv) / rows, 0.0, 1.0)
                u = (np.arange(columns) + du) / columns + 0.5
                row = np.minimum((v * image.shape[0]).astype(int), image.shape[0] - 1)
                column = (u * image.shape[1]).astype(int) % image.shape[1]
                total += 0.25 * image[row[:, None], column]
    return {"type": "envmap", "bitmap": mi.Bitmap(total.astype(np.float32))}
