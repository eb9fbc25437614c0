"""Mitsuba 3's rays from what a camera sees: vectorised, all of them in one compiled loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.sampling import r_points
from ssgi_cl.truth import Truth
from ssgi_cl.truth.mitsuba_scene import best_variant, within
from ssgi_cl.truth.path_tracer import PathTracer

from ..case import Subject
from ..context import Context
from . import oidn
from .extras import missing_package

VARIANT = "llvm_ad_rgb"
SEED = 20


def missing(*, denoised: bool = False) -> str:
    """Return why Mitsuba can't run vectorised on the CPU here, or the denoiser; "" if they can."""
    why = missing_package("mitsuba", "truth")
    if not why and best_variant() != VARIANT:
        why = "mitsuba finds no libLLVM of version 17 or later (Debian: libllvm19)"
    return why or (oidn.missing() if denoised else "")


class Estimator:
    """The mean of what a tracer's paths find out, from visible points that are looked for once.

    Unlike `PathTracer.image`, which makes its random numbers in numpy and runs path by path, this
    is as fast as Mitsuba allows.

    Args:
        context: whose camera sees the points.
        tracer: made `within` the variant; its `estimate` is what is averaged.
    """

    def __init__(self, context: Context, tracer: PathTracer) -> None:
        self._tracer = tracer
        self._size = context.size
        with within(VARIANT) as mi:
            start, way, length = tracer.sight(context.camera, slice(0, context.size[0]))
            ray = mi.Ray3f(mi.Point3f(start), mi.Vector3f(way), mi.Float(length), 0.0, [])
            self._seen = tracer.surface(ray, mi.Bool(context.seen.ravel()))
            # Points of the R sequence, moved round the unit cube by a random shift in each pixel;
            # in parts of 2^-32.
            count = tracer.numbers + tracer.sky_numbers
            self._steps = [round(2**32 * step) for step in r_points(0, 1, count)[0]]
            random = np.random.default_rng(SEED)
            self._shifts = [
                mi.UInt32(random.integers(2**32, size=context.seen.size, dtype=np.uint32))
                for _ in range(count)
            ]
            tracer.dr.eval(self._seen, self._shifts)
            tracer.dr.sync_thread()

    def mean(self, paths: int) -> NDArray[np.float32]:
        """Return the mean of `paths` estimates, [rows, columns, 3] float32; 0 where nothing is."""
        dr, seen = self._tracer.dr, self._seen
        with within(VARIANT) as mi:

            def another(done: Any, total: Any) -> tuple[Any, Any]:
                # The upper 24 bits are what a float32 in [0, 1) can hold.
                numbers = [
                    mi.Float((shift + (done + 1) * mi.UInt32(step)) >> 8) * 2.0**-24
                    for shift, step in zip(self._shifts, self._steps, strict=True)
                ]
                found = self._tracer.estimate(seen, numbers)
                return done + 1, total + dr.select(seen.there, found, 0.0)

            last = mi.UInt32(paths)  # not a constant of the code, which then serves any number
            start = mi.UInt32(0), dr.zeros(mi.Color3f, self._size[0] * self._size[1])
            _, total = dr.while_loop(start, lambda done, total: done < last, another)
            image = np.array(total, np.float32).T / np.float32(paths)
        return image.reshape(*self._size, 3)


def subject(
    context: Context,
    image: Callable[[], NDArray[np.float32]],
    count: int,
    quantity: str,
    world: Callable[[], Truth],
    *,
    denoised: bool,
) -> Subject:
    """Return what averages `count` rays or paths a pixel into an image, denoised if asked for."""
    run, also = (oidn.denoised(context, image), ", with the denoiser") if denoised else (image, "")
    return Subject(
        run=run,
        image=run,
        on_device=False,
        quantity=quantity,
        samples=float(count) * np.count_nonzero(context.seen),
        truths={"world": world},
        note=f"without search tree and primary visibility{also}",
    )
