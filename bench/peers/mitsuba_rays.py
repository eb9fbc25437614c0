"""Occlusion and one bounce by Mitsuba 3's rays: Embree in wide packets, all of them in one kernel.

The kernel is recorded once and replayed (`drjit.freeze`), so that no Python runs between the call
and the image. A lane for each pixel, which loops over its rays: a lane for each ray takes twice the
time for paths, and is between a fifth faster and an eighth slower for occlusion.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.sampling import r_points
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams
from ssgi_cl.truth.light import MOST_PATHS
from ssgi_cl.truth.mitsuba_scene import best_variant, within
from ssgi_cl.truth.path_tracer import OneBounce, PathTracer, Surface
from ssgi_cl.truth.ray_ao import MOST_RAYS
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context

from .embree import Tree
from .extras import missing_package

Floats = NDArray[np.float32]

VARIANT = "llvm_ad_rgb"
SEED = 1 << 33
"""Of random numbers: no pass of a reference has it, nor a pair that begins with it."""
QUALITY = "fast"
"""Of Intel's Open Image Denoise, the quickest: twice as fast as "high", for an RMSE that is at most 1.12
times as large."""
BLURS = {1: BilateralParams(radius=8, normal_sigma=0.7), 4: BilateralParams(radius=5), 16: BilateralParams(radius=2)}
"""The blur for as many rays a pixel and more: of radii 2 to 8 px and sigmas .3 to 1 those of the
least mean error on `REPORTED`, though our own techniques are tuned on other scenes."""


def missing(*, denoised: bool = False) -> str:
    """Return why Mitsuba can't run vectorised on the CPU here, or the denoiser; "" if they can."""
    why = missing_package("mitsuba", "truth")
    if not why and best_variant() != VARIANT:
        why = "mitsuba finds no libLLVM of version 17 or later (Debian: libllvm19)"
    return why or (missing_package("pyoidn", "peers") if denoised else "")


class Estimator:
    """The mean of what a tracer's paths find out, from visible points that are looked for once.

    Args:
        context: whose camera sees the points.
        tracer: made `within` the variant; its `estimate` is what is averaged.
        paths: how many a pixel.
        scalar: whether an estimate is one number, not a colour.
    """

    def __init__(self, context: Context, tracer: PathTracer, paths: int, *, scalar: bool = False) -> None:
        self._tracer = tracer
        self._scalar = scalar
        self._size = context.size
        self._paths = paths
        with within(VARIANT) as mi:
            start, way, length = tracer.view_rays(context.camera, slice(0, context.size[0]))
            ray = mi.Ray3f(mi.Point3f(start), mi.Vector3f(way), mi.Float(length), 0.0, [])
            seen = tracer.surface(ray, mi.Bool(context.seen.ravel()))
            # Points of the R sequence, moved round the unit cube by a random shift in each pixel;
            # in parts of 2^-32.
            count = tracer.numbers + tracer.sky_numbers
            self._steps = [round(2**32 * step) for step in r_points(0, 1, count)[0]]
            random = np.random.default_rng(SEED)
            shifts = [mi.UInt32(random.integers(2**32, size=context.seen.size, dtype=np.uint32)) for _ in range(count)]
            # Not a constant of the code, which then serves any number.
            last = tracer.dr.opaque(mi.UInt32, paths)
            tracer.dr.eval(seen, shifts)
            tracer.dr.sync_thread()
            self._inputs = (tracer._world.scene, list(seen), shifts, last)
            self._sum = self._recorded()

    def mean(self) -> NDArray[np.float32]:
        """Return the mean of the estimates, [rows, columns, 3] float32; 0 where nothing is.

        Of an estimate of one number all three are the same.
        """
        with within(VARIANT):
            total = np.array(self._sum(*self._inputs), np.float32)
        mean = total.reshape(-1, self._size[0] * self._size[1]) / np.float32(self._paths)
        image: NDArray[np.float32] = np.broadcast_to(mean, (3, mean.shape[1])).T
        return image.reshape(*self._size, 3)

    def _recorded(self) -> Callable[..., Any]:
        """Return what gives the sum of the estimates of each pixel, recorded.

        Where a scene has what can't be recorded, such as a texture in Python, it is traced in
        every call instead.
        """
        tracer, steps, scalar = self._tracer, self._steps, self._scalar
        dr, mi = tracer.dr, tracer.mi

        def sums(scene: Any, seen: Any, shifts: Any, last: Any) -> Any:
            at = Surface(*seen)

            def another(done: Any, total: Any) -> tuple[Any, Any]:
                # The upper 24 bits are what a float32 in [0, 1) can hold.
                numbers = [
                    mi.Float((shift + (done + 1) * mi.UInt32(step)) >> 8) * 2.0**-24
                    for shift, step in zip(shifts, steps, strict=True)
                ]
                found = tracer.estimate(at, numbers)
                return done + 1, total + dr.select(at.there, found, 0.0)

            zero = dr.zeros(mi.Float if scalar else mi.Color3f, dr.width(at.there))
            return dr.while_loop((mi.UInt32(0), zero), lambda done, total: done < last, another)[1]

        recorded: Callable[..., Any] = dr.freeze(sums)
        # Freeing an object of Mitsuba's while a kernel is recorded ends the process.
        gc.collect()
        dr.sync_thread()
        gc.disable()
        try:
            recorded(*self._inputs)
        except RuntimeError:
            return sums
        finally:
            gc.enable()
        return recorded


def denoised_by_oidn(context: Context, noisy: Callable[[], Floats]) -> Callable[[], Floats]:
    """Return what computes an image and denoises it, guided by the G-buffer's normals.

    Chosen among the denoiser's modes by the RMSE of 1, 4 and 16 rays a pixel on both built-in
    scenes: HDR for A too (for low dynamic range it takes the zeros and ones of a few rays for
    something else, and turns out up to .2 too bright), and guides that are not declared noise-free.
    Neither A nor irradiance depends on the albedo, so its guide is white; OIDN wants one with the
    normals.

    Args:
        context: whose G-buffer guides the denoiser.
        noisy: returns A [rows, columns] in [0, 1], or irradiance [rows, columns, 3].
    """
    pyoidn = import_module("pyoidn")
    normal = context.host_gbuffer.first("normal")
    white = np.ones_like(normal)

    def run() -> Floats:
        image = noisy()
        color = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=-1)
        result: Floats = pyoidn.denoise(color, white, normal, hdr=True, quality=QUALITY)
        return result if image.ndim == 3 else np.clip(result[..., 0], 0.0, 1.0)

    return run


class Occlusion(PathTracer):
    """1 - A, cosine-weighted, of a scene without lights."""

    numbers = 2

    def __init__(self, context: Context) -> None:
        super().__init__(context.view.scene, (), VARIANT)
        self._radius = context.radius
        self._curve = _curve(self.dr, context.truths.attenuation)

    def estimate(self, seen: Surface, numbers: Sequence[Any]) -> Any:
        """Return V * W of a ray; those that start into the surface meet it at distance 0."""
        mi, dr, scene = self.mi, self.dr, self._world.scene
        way = self._cosine_distributed(seen, numbers)
        above = dr.dot(seen.normal, way) > 0.0
        ray, active = mi.Ray3f(seen.front, way, self._radius, 0.0, []), seen.there & above
        if self._curve is None:
            met = dr.select(scene.ray_test(ray, active), 1.0, 0.0)
        else:
            hit = scene.ray_intersect_preliminary(ray, active=active)
            met = dr.select(hit.is_valid(), self._curve(hit.t / self._radius), 0.0)
        return dr.select(above, met, 1.0)


def occlusion(context: Context, setting: str, *, then: str = "", moving: bool = False) -> Subject:
    """Build the search tree and find the visible points; the setting is the number of rays a pixel.

    Args:
        context, setting: see `Family`.
        then: what follows: "" nothing, "blur" this library's edge-aware blur, on the device, or
            "oidn" Intel's denoiser.
        moving: whether Embree builds the search tree in every run, as for a mesh that moves.
            Mitsuba does not build one in place, so embreex builds that of the same triangles.
    """
    rays = count_of(setting, "rays per pixel", 1, MOST_RAYS)
    with within(VARIANT):
        tracer = context.shared("Mitsuba's occlusion", lambda: Occlusion(context))
        estimator = Estimator(context, tracer, rays, scalar=True)
    tree = context.shared("embreex's tree", lambda: Tree(context.view.scene))

    def cast() -> Floats:
        if moving:
            tree.build()
        image: Floats = np.clip(np.float32(1.0) - estimator.mean()[..., 0], 0.0, 1.0)
        return image

    run: Callable[[], Floats] = cast
    counted = "tree built, rays made and cast" if moving else "rays made and cast"
    if then == "blur":
        blur = BLURS[max(least for least in BLURS if least <= rays)]
        run = blurred(context, cast, blur)
        counted += f", copied to the device, blurred ({blur.radius} px), copied back"
    elif then == "oidn":
        run = denoised_by_oidn(context, cast)
        counted += ", denoised"
    return Subject.of_image(
        run,
        setup=tree.bring if moving else None,
        on_device=False,
        quantity="occlusion",
        samples=float(rays) * context.surface_pixels,
        truths={"world": context.occlusion},
        counted=counted,
    )


def blurred(context: Context, cast: Callable[[], Floats], params: BilateralParams) -> Callable[[], Floats]:
    """Return what casts rays, blurs the result on the device and gives it as an image."""
    noisy = context.runtime.plane(1, context.size)
    blur = Bilateral(context.runtime, context.size, params)

    def run() -> Floats:
        noisy.upload(cast()[None])
        image: Floats = blur.run(context.gbuffer, noisy).download()[0]
        return image

    return run


def _curve(dr: Any, attenuation: str) -> Callable[[Any], Any] | None:
    """Return W as a function of the distance in radii, or None where it is 1."""
    curves: dict[str, Callable[[Any], Any] | None] = {
        "none": None,
        "linear": lambda share: 1.0 - share,
        "quadratic": lambda share: 1.0 - share * share,
        "exponential": lambda share: dr.exp(-share),
    }
    return curves[attenuation]


def one_bounce(context: Context, setting: str, *, denoised: bool = False) -> Subject:
    """Build the search tree and find the visible points of one diffuse bounce, denoised or not.

    The reference's own estimator with fewer paths; the setting is their number a pixel.
    """
    paths = count_of(setting, "paths per pixel", 1, MOST_PATHS)
    lights = context.some_lights()
    with within(VARIANT):
        tracer = context.shared("Mitsuba's paths", lambda: OneBounce(context.view.scene, lights, VARIANT))
        estimator = Estimator(context, tracer, paths)
    return Subject.of_image(
        denoised_by_oidn(context, estimator.mean) if denoised else estimator.mean,
        on_device=False,
        quantity="bounce",
        samples=float(paths) * context.surface_pixels,
        truths={"world": context.bounce},
        counted="paths made and traced" + (", denoised" if denoised else ""),
    )


def families(prepare: Callable[..., Subject], **options: Any) -> dict[str, Family]:
    """Return the ending of a name -> family, without the denoiser and with it."""
    return {
        suffix: Family(
            partial(prepare, denoised=denoised, **options),
            ("1", "4", "16", "64"),
            missing=partial(missing, denoised=denoised),
        )
        for suffix, denoised in (("", False), ("-oidn", True))
    }


def _occlusions(*, moving: bool) -> dict[str, Family]:
    return {
        f"mitsuba-ao{'-moving' if moving else ''}{then and '-' + then}": Family(
            partial(occlusion, then=then, moving=moving),
            ("1", "4", "16") if then or moving else ("1", "4", "16", "64"),
            missing=partial(missing, denoised=then == "oidn"),
        )
        for then in ("", "blur", "oidn")
    }


STATIC: Mapping[str, Family] = {
    **_occlusions(moving=False),
    **{f"mitsuba-path{suffix}": family for suffix, family in families(one_bounce).items()},
}
"""Of a mesh that does not move."""
MOVING: Mapping[str, Family] = _occlusions(moving=True)
"""Of a mesh that moves."""
FAMILIES: Mapping[str, Family] = {**STATIC, **MOVING}
