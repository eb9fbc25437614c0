"""Direct light and one diffuse bounce, as they are in the world: traced through Mitsuba 3."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment, Light, light_tuple
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.progress import Progress
from ssgi_cl.truth import digests, mitsuba_scene
from ssgi_cl.truth.estimators import versioned
from ssgi_cl.truth.path_tracer import BounceWithoutVisibility, DirectLight, OneBounce, PathTracer
from ssgi_cl.truth.store import Truth, accumulated

Floats = NDArray[np.float32]

MOST_PATHS = 1 << 20
"""Paths per pixel, at most."""

PASSES = 8
"""Independent sets of paths, whose spread tells the error, at least, from 64 paths on. More tell it
better and make it greater: with 256 paths and one bounce in the Cornell box, 1, 4, 8, 16 and 32
sets have an RMSE of 8, 11, 14, 16 and 17 % of the mean."""

_LONGEST = 64  # paths of a pixel in one pass: what an interrupted run may lose


def direct_light(
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    paths: int = 256,
    *,
    rebuild: bool = False,
    progress: Progress = None,
) -> Truth:
    """Return the irradiance by light that comes straight from lights, at what each pixel shows.

    At the point of the mesh on the view ray through the pixel's centre, with the mesh's
    interpolated normal turned to the side of the triangle that faces the viewer; light from behind
    the triangle does not count. Radiance of a diffuse surface is albedo / pi times it.

    Spot, point and directional lights are summed exactly (standard error 0); environments are
    sampled. Surfaces' own emission is left out: light comes from `lights` alone. Holes that a
    texture's alpha cuts out let rays of view and light through.

    Args:
        scene: what `rasterize.load_scene` returns.
        camera: whose near and far plane bound what is seen, but not what casts shadows.
        lights: at least one.
        paths: samples of the environments per pixel, 1 to 2^20; they are split into independent
            passes, 8 or more from 64 paths on and about the square root of `paths` below, and
            rounded up to a multiple of that. Of a single path the error is unknown (infinite).
        rebuild: make it anew even where it is kept.
        progress: called with the share that is done, which grows to 1. True: a bar in terminals and notebooks.

    Returns:
        Irradiance E in W/m^2 and its standard error, [rows, columns, 3] float32 each; 0 where
        nothing is seen. Kept on disk under a hash of all arguments, of this code, and of Mitsuba's
        version and variant ("llvm_ad_rgb", or "scalar_rgb" without LLVM 17 or later).

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range; no lights.
        MissingExtraError: mitsuba is not installed; it comes with the extra `truth`.
        TruthError: what is kept is damaged.
    """
    return _truth("direct", DirectLight, scene, camera, lights, paths, rebuild, progress)


def one_bounce(
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    paths: int = 256,
    *,
    visibility: bool = True,
    rebuild: bool = False,
    progress: Progress = None,
) -> Truth:
    """Return the irradiance by light that one diffuse surface has reflected on its way.

    E(x) = Int albedo(y)/pi E_direct(y) cos dw with y where a ray from x ends. All surfaces reflect
    on both sides and transmit nothing: what counts at y is the light on the side that faces x.
    Light that reaches x straight from an environment is direct light.

    Args:
        visibility: without it light passes from y to x through everything, as it does when a
            reflective shadow map is gathered: all surfaces along a ray count, each with the light
            that does reach it. (This is the integral over all lit surfaces without V(x, y), but
            free of the peak of 1 / d^2.) From lights to y walls still cast shadows.
        The rest is as in `direct_light`.

    Returns:
        As `direct_light`. Two surfaces closer than 2^-20 of their coordinates are one.
    """
    if not isinstance(visibility, bool):
        raise TypeError(f"visibility is {visibility!r}: expected True or False")
    kind = "bounce" if visibility else "bounce-through-walls"
    tracer = OneBounce if visibility else BounceWithoutVisibility
    return _truth(kind, tracer, scene, camera, lights, paths, rebuild, progress)


def _truth(
    kind: str,
    tracer: type[PathTracer],
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    paths: int,
    rebuild: bool,
    progress: Progress,
) -> Truth:
    lights = checked_inputs(scene, camera, lights)
    if not lights:
        raise ValueError("lights is empty: expected at least one light")
    exact = tracer is DirectLight and not any(isinstance(light, Environment) for light in lights)
    description = {"kind": kind, "estimator": versioned("light")}
    return traced(description, tracer, scene, camera, lights, paths, exact=exact, rebuild=rebuild, progress=progress)


def traced(
    description: dict[str, Any],
    tracer: Callable[[Scene, Sequence[Light], str], PathTracer],
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    paths: int,
    *,
    exact: bool,
    rebuild: bool,
    progress: Progress,
) -> Truth:
    """Return the mean of a tracer's images, the kept one or made now.

    Args:
        description: what determines an image beside scene, camera, lights and Mitsuba.
        tracer: is made of scene, lights and a variant of Mitsuba.
        scene, camera, lights, paths, rebuild, progress: see `direct_light`.
        exact: images have no noise, so that one path is enough.
    """
    passes, per_pass = _passes_of(paths)
    if exact:
        passes = per_pass = 1
    variant = mitsuba_scene.best_variant()
    description |= {
        "scene": digests.scene_digest(scene),
        "camera": digests.camera_description(camera),
        "lights": [digests.light_description(light) for light in lights],
        "paths of a pass": per_pass,
        "variant": variant,
        "mitsuba": mitsuba_scene.mitsuba().__version__,
    }
    prepared = cache(lambda: tracer(scene, lights, variant))  # only if something has to be computed

    def make(number: int) -> Floats:
        with mitsuba_scene.within(variant):
            return prepared().image(camera, per_pass, number)

    return accumulated(description, passes, make, exact=exact, rebuild=rebuild, progress=progress)


def checked_inputs(scene: Scene, camera: Camera, lights: Sequence[Light]) -> tuple[Light, ...]:
    """Return the lights, after a check of the types of scene, camera and lights."""
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {type(scene).__name__}: expected a Scene (see ssgi_cl.rasterize.load_scene)")
    if not isinstance(camera, Camera):
        raise TypeError(f"camera is {camera!r}: expected an ssgi_cl.Camera")
    return light_tuple(lights)


def _passes_of(paths: int) -> tuple[int, int]:
    """Return the number of independent passes for `paths` per pixel, and the paths of each."""
    paths = checks.integer("paths", paths, low=1, high=MOST_PATHS, unit="paths per pixel")
    passes = max(min(PASSES, math.isqrt(paths)), min(paths, 2), math.ceil(paths / _LONGEST))
    return passes, math.ceil(paths / passes)
