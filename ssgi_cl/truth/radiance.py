"""The whole frame as it is in the world: radiance of every pixel, traced through Mitsuba 3."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import get_args

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment, Light, light_extent
from ssgi_cl.core.names import All, Bounces
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.progress import Progress
from ssgi_cl.truth.estimators import versioned
from ssgi_cl.truth.light import checked_inputs, traced
from ssgi_cl.truth.radiance_tracer import MOST_BOUNCES, RadianceTracer
from ssgi_cl.truth.store import Truth


def radiance(
    scene: Scene,
    camera: Camera,
    lights: Sequence[Light],
    paths: int = 256,
    bounces: Bounces = "all",
    *,
    box_filter: bool = False,
    rebuild: bool = False,
    progress: Progress = None,
) -> Truth:
    """Return the radiance that each pixel sees: all light of a scene.

    L = albedo / pi (E_direct + E_reflected) + specular L_lobe + emission at the point of the mesh
    on the view ray; the environments' radiance where that meets nothing between the camera's
    planes. L_lobe is the integral of arriving radiance times (n + 1) / (2 pi) cos^n(a) over the
    directions above the surface, where a is the angle to the mirrored view ray and n the gloss
    (Phong 1975; the lobe integrates to 1 over the sphere, as in Lewis 1994). Light comes from
    `lights` and from emissive materials, which emit on both sides. Surfaces reflect on both sides.
    Holes that a texture's alpha cuts out let view rays and light through. Of a surface that
    blends, the share alpha times its texture's alpha is there; of that, `Material.transmission`
    is the share [3] of light that passes straight through, to the eye and from lights. A light of
    some radius or angle shines as strongly as a point in its middle, and is hidden as far as its
    disc is.

    Args:
        scene: what `rasterize.load_scene` returns.
        camera: whose near and far plane bound what is seen, but not what casts shadows.
        lights: any number; none leaves the emission of materials.
        paths: per pixel, 1 to 2^20, split into independent passes as in `direct_light`.
        bounces: reflections between the light's first surface and the one that is seen: 0 for
            direct light and emission, at most 1024; "all" for as many as it takes, where Russian
            roulette ends paths (and 1024 bounces those in a closed scene that absorbs nothing,
            whose radiance is infinite).
        box_filter: mean over each pixel's area in place of its centre's radiance.
        rebuild: make it anew even where it is kept.
        progress: called with the share that is done, which grows to 1. True: a bar in terminals and notebooks.

    Returns:
        Radiance in W m^-2 sr^-1 and its standard error, [rows, columns, 3] float32 each. Kept on
        disk under a hash of all arguments, the estimator's version, and Mitsuba's version and
        variant.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
        MissingExtraError: mitsuba is not installed; it comes with the extra `truth`.
        TruthError: what is kept is damaged.
    """
    lights = checked_inputs(scene, camera, lights)
    checks.switch("box_filter", box_filter)
    most = _most_bounces(bounces)
    emits = any(m.emits for m in scene.used_materials)
    glossy = any(m.is_glossy for m in scene.used_materials)
    soft = any(light_extent(light) > 0.0 for light in lights)
    sampled = (
        box_filter or emits or soft or scene.is_seen_through or any(isinstance(light, Environment) for light in lights)
    )
    description = {
        "kind": "radiance",
        "bounces": bounces,
        "box filter": box_filter,
        "estimator": versioned(
            "blended radiance" if scene.is_seen_through else "glossy radiance" if glossy else "radiance"
        ),
        **({"lights' sizes": True} if soft else {}),
    }
    tracer = partial(RadianceTracer, bounces=most, box_filter=box_filter)
    exact = most == 0 and not sampled
    return traced(description, tracer, scene, camera, lights, paths, exact=exact, rebuild=rebuild, progress=progress)


def _most_bounces(bounces: Bounces) -> int:
    if isinstance(bounces, str):
        if bounces not in get_args(All):
            raise ValueError(f"bounces is {bounces!r}: expected 'all' or an integer, 0 to {MOST_BOUNCES}")
        return MOST_BOUNCES
    return checks.integer("bounces", bounces, low=0, high=MOST_BOUNCES)
