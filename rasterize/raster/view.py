"""The G-buffer of a scene."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import Floats, GBuffer
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.scene_parts import without_holes
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.raster.rasterizer import Before, Rasterizer

MOST_LAYERS = 16
ATTRIBUTES = ("first", "all")
"""Layers that have normal, albedo and emission."""


def margin_of(camera: Camera, overscan: float) -> Size:
    """Return (rows, columns) of the margin that is `overscan` of the image on every side."""
    share = checks.number("overscan", overscan, low=0.0, high=1.0, unit="share of the image's size")
    return math.ceil(share * camera.height), math.ceil(share * camera.width)


def _check_scene(scene: object) -> None:
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {type(scene).__name__}: expected a Scene (see ssgi_cl.rasterize.load_scene)")


def device_scene(scene: Scene, runtime: Runtime) -> DeviceScene:
    """Return the scene in device memory; the same object for the same scene, while it is kept.

    It goes with the scene.
    """
    _check_scene(scene)
    scene = without_holes(scene)
    kept: DeviceScene = runtime.prepared((DeviceScene, scene.key), lambda: DeviceScene(runtime, scene), of=scene)
    return kept


@checked_keywords
def gbuffer(
    scene: Scene,
    camera: Camera,
    *,
    layers: int = 1,
    overscan: float = 0.0,
    attributes: str = "first",
    thickness: bool = False,
    backend: str = "opencl",
    previous_camera: Camera | None = None,
    previous_scene: Scene | None = None,
    runtime: Runtime | None = None,
) -> GBuffer:
    """Draw a scene into a G-buffer.

    Args:
        scene: what `load_scene` returns, or one of your own making.
        camera: whose size is that of results computed from the G-buffer.
        layers: depth layers, 1 to 16; a deeper layer is the nearest surface that lies more than
            1e-5 of the depth behind the layer before.
        overscan: margin of the arrays on every side, a share of the image's height and width in
            [0, 1].
        attributes: "first" for normal, albedo and emission of the front layer, "all" for those of
            every layer.
        thickness: whether the result has `thickness` of every layer: of closed surfaces, by drawing their inner
            sides too. It is 0 for these, and -1, not known, for open surfaces and those that have holes, let light
            pass or whose back is not there.
        backend: "opencl", or "pyrender" for OpenGL (needs the extra `opengl`).
        previous_camera: of the previous image, for `motion`; by default `camera`, if `previous_scene` is given.
        previous_scene: the scene as the previous image showed it: the same triangles, whose positions may be others
            (`rasterize.moved`); by default `scene`, if `previous_camera` is given.
        runtime: the device of the OpenCL backend; by default the fastest found.

    Returns:
        depth ([layers, rows, columns] with more than one layer), normal, albedo and, if the scene
        emits light, emission ([layers, rows, columns, 3] with "all" and more than one layer); of
        a scene with glossy materials specular and gloss of the front layer; motion of the front layer if a previous
        camera or scene is given; thickness if that is asked for ([layers, rows, columns] with more than one layer).
        Normals are the mesh's own, not turned to the viewer.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
        MissingExtraError: the pyrender backend can't run; the message says what is missing.
    """
    _check_scene(scene)
    layers = checks.integer("layers", layers, low=1, high=MOST_LAYERS)
    checks.choice("backend", backend, ("opencl", "pyrender"))
    checks.switch("thickness", thickness)
    if thickness and backend == "pyrender":
        raise ValueError("thickness=True applies only to backend='opencl' (got 'pyrender')")
    shaded = layers if checks.choice("attributes", attributes, ATTRIBUTES) == "all" else 1
    for name, value in (("camera", camera), ("previous_camera", previous_camera or camera)):
        if not isinstance(value, Camera):
            raise TypeError(f"{name} is {value!r}: expected an ssgi_cl.Camera")
    moving = previous_camera is not None or previous_scene is not None
    if moving:
        _check_same_triangles(scene, scene if previous_scene is None else previous_scene)
    margin = margin_of(camera, overscan)
    if backend == "pyrender":
        if moving:
            raise ValueError("previous_camera and previous_scene apply only to backend='opencl' (got 'pyrender')")
        from ssgi_cl.rasterize.raster import opengl

        arrays = opengl.gbuffer_arrays(without_holes(scene), camera.with_margin(margin), layers)
        arrays |= {name: arrays[name][:shaded] for name in ("normal", "albedo", "emission")}
        if not arrays["emission"].any():
            del arrays["emission"]
        return _host(camera, arrays)
    previous = (previous_scene or scene, previous_camera or camera) if moving else None
    return _drawn(scene, camera, layers, margin, shaded, previous, thickness=thickness, runtime=runtime)


def _check_same_triangles(scene: Scene, previous: Scene) -> None:
    """Raise TypeError or ValueError unless a scene has the triangles of another, wherever they are."""
    if not isinstance(previous, Scene):
        raise TypeError(f"previous_scene is {type(previous).__name__}: expected a Scene")
    if previous.positions.shape != scene.positions.shape or not np.array_equal(previous.triangles, scene.triangles):
        raise ValueError(
            f"previous_scene has {len(previous.positions)} vertices and {len(previous.triangles)} triangles: expected "
            f"the {len(scene.positions)} vertices and {len(scene.triangles)} triangles of scene, in the same order"
        )


@serialised
def _drawn(
    scene: Scene,
    camera: Camera,
    layers: int,
    margin: Size,
    shaded: int,
    previous: tuple[Scene, Camera] | None,
    *,
    thickness: bool,
    runtime: Runtime | None,
) -> GBuffer:
    runtime = runtime or Runtime.open()
    kept = device_scene(scene, runtime)
    before = None if previous is None else Before(device_scene(previous[0], runtime), previous[1])
    rasterizer: Rasterizer = runtime.prepared(
        (Rasterizer, camera.size, layers, margin, True, shaded, thickness),
        lambda: Rasterizer(
            runtime, camera.size, layers=layers, margin=margin, attributes=shaded, lobes=True, thickness=thickness
        ),
    )
    with runtime.frame():
        return downloaded(rasterizer.render(kept, camera, before=before))


def downloaded(target: DeviceGBuffer) -> GBuffer:
    """Return a copy of a device G-buffer in host memory, normals in world space."""
    if target.camera is None:
        raise ValueError("the device G-buffer is empty: draw or upload something first")
    arrays = {"depth": target.depth.download()}
    arrays |= {"normal": _layers_of(target.normal_world), "albedo": _layers_of(target.albedo)}
    if target.emits:
        arrays["emission"] = _layers_of(target.emission)
    if target.mirrors:
        arrays |= {"specular": _layers_of(target.specular)[0], "gloss": target.gloss.download()[0]}
    if target.moves:
        arrays["motion"] = _layers_of(target.motion)[0][..., : target.moves]
    if target.thickness is not None:
        arrays["thickness"] = target.thickness.download()
    return _host(target.camera, arrays, exact=target.is_exact)


def _layers_of(plane: Plane) -> Floats:
    """Return [layers, rows, columns, 3] of a plane that has three images for each layer."""
    return np.moveaxis(plane.download().reshape(-1, 3, *plane.size), 1, -1)


def _host(camera: Camera, arrays: dict[str, Floats], *, exact: bool = True) -> GBuffer:
    """Return a G-buffer of arrays; those with an axis of layers lose it if there is one layer alone."""
    layered = [name for name in ("depth", "normal", "albedo", "emission", "thickness") if name in arrays]
    flat: dict[str, Any] = arrays | {name: arrays[name][0] for name in layered if len(arrays[name]) == 1}
    gbuffer = GBuffer(camera=camera, **flat)
    object.__setattr__(gbuffer, "exact", exact)
    return gbuffer
