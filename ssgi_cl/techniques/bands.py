"""Images of any size within a limit of memory: computed in bands of rows, with the bits of the whole."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import wraps
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np

from ssgi_cl.core import checks
from ssgi_cl.core.array_kinds import host_array, kind_among, of_kind
from ssgi_cl.core.errors import DeviceMemoryError
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.gbuffer_band import band_of, rows_with_padding
from ssgi_cl.core.gbuffer_batch import image_by_image, images_in
from ssgi_cl.core.keywords import check_keywords
from ssgi_cl.device.runtime import Runtime

ALIGNED = 64
"""Rows that bands begin at multiples of."""
REPEATED = 16
"""Rows after which every pattern repeats: 4, of every fourth pixel at quarter size."""
CELL = 64
"""Rows of the coarsest cells that light is interpolated from."""
NORMAL_ROWS = 2
"""Rows on either side of a pixel that its normal is reconstructed from."""
LEAST_MEMORY, MOST_MEMORY = 1 << 20, 1 << 62
"""Range of `max_memory`, bytes."""
PIXEL_BYTES = 56
"""Of device memory for a pixel and layer: depth, normals and albedo, a technique's copy and its result. Bands are tried
with as many rows as then fit, and with fewer where a technique takes more."""

P = ParamSpec("P")
T = TypeVar("T")


class Plan(NamedTuple):
    """A call, so that bands of its G-buffer give the bits of the whole.

    Attributes:
        arguments: of the function, by name, without the G-buffer; what depends on the whole image is a value.
        computed: rows on either side whose results are filtered into those that are kept.
        read: how many rows beyond these the G-buffer is read, if its depths there are at least a number of
            scene units.
        images: arguments that are arrays [rows, columns, ...] of the image's every so-many-th pixel: the step.
        planes: arguments that are arrays of the size of the depth, with margin.
    """

    arguments: Mapping[str, Any]
    computed: int
    read: Callable[[float], float] = lambda nearest: NORMAL_ROWS
    images: Mapping[str, int] = {}
    planes: tuple[str, ...] = ()


Planner = Callable[[GBuffer, Runtime, Mapping[str, Any]], Plan]


def banded(plan: Planner) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Make a technique's function work in bands where it is called with `max_memory`."""

    def decorated(function: Callable[P, T]) -> Callable[P, T]:
        signature = inspect.signature(function)

        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> T:
            most = kwargs.get("max_memory")
            if most is None:
                return function(*args, **kwargs)
            most = checks.integer("max_memory", most, low=LEAST_MEMORY, high=MOST_MEMORY, unit="bytes")
            check_keywords(function, kwargs)
            images = images_in(args, kwargs)
            if images is not None:
                stacked: T = image_by_image(call, images, args, kwargs)
                return stacked
            arguments = dict(signature.bind(*args, **kwargs).arguments)
            del arguments["max_memory"]
            arguments |= arguments.pop("params", {})
            gbuffer = arguments.pop("gbuffer")
            runtime = arguments.pop("runtime", None) or getattr(gbuffer, "runtime", None) or Runtime.open()
            if not isinstance(gbuffer, GBuffer):
                raise TypeError(
                    f"max_memory is {most}: expected None with a {type(gbuffer).__name__}, bands are cut from a GBuffer"
                )

            found = in_bands(function, gbuffer, runtime, plan(gbuffer, runtime, arguments), most)
            result: T = of_kind(found, kind_among((*args, *kwargs.values())))
            return result

        return call

    return decorated


def fixed_plan(computed: int = 0, images: Mapping[str, int] | None = None) -> Planner:
    """Return the plan of a technique that looks at the same rows round each pixel."""
    return lambda gbuffer, runtime, arguments: Plan(arguments, computed, images=images or {})


def in_bands(function: Callable[..., Any], gbuffer: GBuffer, runtime: Runtime, plan: Plan, most: int) -> Any:
    """Return the result of a technique's function, computed in as many bands as `most` bytes of memory ask for.

    Raises:
        DeviceMemoryError: not even the lowest band fits.
    """
    height = gbuffer.size[0]
    rows = _first_guess(gbuffer, plan, most)
    result: Any = None
    first = 0
    with runtime.lock, _at_most(runtime, most):
        while first < height:
            end = min(first + rows, height)
            whole = (first, end) == (0, height)
            try:
                if whole:
                    return function(gbuffer=gbuffer, **plan.arguments, runtime=runtime)
                band, arguments, above = _band(gbuffer, plan, first, end)
                found = function(gbuffer=band, **arguments, runtime=runtime)
            except DeviceMemoryError as error:
                if rows <= ALIGNED:
                    raise DeviceMemoryError(
                        f"max_memory is {most}: a band of {end - first} rows does not fit with the rows that it reads "
                        f"round it; expected more, or a smaller radius ({error})"
                    ) from error
                rows = max(min(rows, height) * 2 // 3 // ALIGNED * ALIGNED, ALIGNED)
                continue
            result = _gathered(result, found, height, slice(first, end), slice(above, above + end - first))
            first = end
    return result


@contextmanager
def _at_most(runtime: Runtime, most: int) -> Iterator[None]:
    """Lower the limit of a device's memory."""
    memory = runtime.memory
    before = memory.limit
    memory.limit = min(before, most)
    try:
        try:
            # What earlier calls left goes, as far as it is in the way.
            runtime.exclusively(lambda: runtime.require(0, ""))
        except DeviceMemoryError as error:
            raise DeviceMemoryError(f"max_memory is {most}: expected more than what objects hold ({error})") from error
        yield
    finally:
        memory.limit = before


def _first_guess(gbuffer: GBuffer, plan: Plan, most: int) -> int:
    """Return rows of a band that may fit, a multiple of `ALIGNED`, or those of the image."""
    (height, columns), (above, aside) = gbuffer.size, gbuffer.margin
    rows = most // (PIXEL_BYTES * gbuffer.layers * (columns + 2 * aside)) - 2 * above
    if rows >= height:
        return height
    depth: Any = gbuffer.first("depth")
    rows -= 2 * (plan.computed + int(min(plan.read(float(depth.min(initial=np.inf))), height)))
    return max(rows // ALIGNED * ALIGNED, ALIGNED)


def _band(gbuffer: GBuffer, plan: Plan, first: int, end: int) -> tuple[GBuffer, dict[str, Any], int]:
    """Return the band whose result holds rows `first` to before `end`, its arguments, and its rows above these."""
    height, margin = gbuffer.size[0], gbuffer.margin[0]
    top, bottom = max(first - aligned(plan.computed), 0), min(end + aligned(plan.computed), height)
    depth: Any = gbuffer.first("depth")
    nearest = float(depth[top + margin : bottom + margin].min(initial=np.inf))
    halo = aligned(math.ceil(min(plan.read(nearest), height + 2 * margin)))
    arguments = dict(plan.arguments)
    for name, step in plan.images.items():
        image = arguments.get(name)
        # What is wrong with another one, the function says.
        if image is not None and np.shape(image)[:1] == (-(-height // step),):
            arguments[name] = host_array(image)[top // step : -(-bottom // step)]
    for name in plan.planes:
        image = arguments.get(name)
        if image is not None and np.ndim(image) >= 3:
            rows = bottom - top + 2 * (margin + halo)
            arguments[name] = rows_with_padding(host_array(image), np.ndim(image) - 3, top - halo, rows, 0.0)
    return band_of(gbuffer, top, bottom, halo), arguments, first - top


def aligned(rows: int) -> int:
    """Return a number of rows, rounded up to where patterns repeat."""
    return -(-rows // REPEATED) * REPEATED


def _gathered(result: Any, found: Any, height: int, rows: slice, kept: slice) -> Any:
    """Write the rows that are kept of a band's result, an array or several, to that of the whole."""
    if isinstance(found, tuple):
        before = result or (None,) * len(found)
        parts = [_gathered(*each, height, rows, kept) for each in zip(before, found, strict=True)]
        return type(found)(*parts) if hasattr(found, "_fields") else tuple(parts)
    if result is None:
        result = np.empty((height, *found.shape[1:]), found.dtype)
    result[rows] = found[kept]
    return result
