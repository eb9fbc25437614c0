"""Mitsuba 3's rays from what a camera sees: Embree in wide packets, all of them in one kernel.

The kernel is recorded once and replayed (`drjit.freeze`), so that no Python runs between the call
and the image. A lane for each pixel, which loops over its rays: a lane for each ray takes twice the
time for paths, and is between a fifth faster and an eighth slower for occlusion.
"""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.sampling import r_points
from ssgi_cl.truth.mitsuba_scene import best_variant, within
from ssgi_cl.truth.path_tracer import PathTracer, Surface
from ssgi_cl.tuning.context import Context

from . import oidn
from .extras import missing_package

VARIANT = "llvm_ad_rgb"
SEED = 1 << 33
"""Of random numbers: no pass of a reference has it, nor a pair that begins with it."""


def missing(*, denoised: bool = False) -> str:
    """Return why Mitsuba can't run vectorised on the CPU here, or the denoiser; "" if they can."""
    why = missing_package("mitsuba", "truth")
    if not why and best_variant() != VARIANT:
        why = "mitsuba finds no libLLVM of version 17 or later (Debian: libllvm19)"
    return why or (oidn.missing() if denoised else "")


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
