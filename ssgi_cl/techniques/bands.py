"""Images of any size within a limit of memory: computed in bands of rows, with the bits of the whole."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import wraps
from typing import Any, NamedTuple, ParamSpec, Protocol, TypeVar

import numpy as np

from ssgi_cl.core import checks
from ssgi_cl.core.array_kinds import host_array, kind_among, of_kind
from ssgi_cl.core.errors import DeviceMemoryError
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.gbuffer_band import band_of, rows_with_padding
from ssgi_cl.core.gbuffer_batch import image_by_image, images_in
from ssgi_cl.core.keywords import check_keywords
from ssgi_cl.device.gbuffer import NORMAL_ROWS
from ssgi_cl.device.memory import DeviceMemory
from ssgi_cl.device.runtime import Runtime

ALIGNED = 64
"""Rows that bands begin at multiples of."""
REPEATED = 32
"""Rows after which every pattern repeats: 8, of every fourth pixel at quarter size."""
CELL = 64
"""Rows of the coarsest cells that light is interpolated from."""
LEAST_MEMORY, MOST_MEMORY = 1 << 20, 1 << 62
"""Range of `max_memory`, bytes."""
SAME_HALO = 1.3
"""Times the rows that a band needs round it that it takes where the one before had as many: memory is used again."""
FILLED, GROWN = 0.75, 1.2
"""Share of the memory that bands are meant to fill, and times their rows that they grow by to do so."""
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
        whole: makes the result of what the bands give together, within so many bytes of device memory.
    """

    arguments: Mapping[str, Any]
    computed: int
    read: Callable[[float], float] = lambda nearest: NORMAL_ROWS
    images: Mapping[str, int] = {}
    planes: tuple[str, ...] = ()
    whole: Callable[[Any, int], Any] = lambda found, max_memory: found


Planner = Callable[[GBuffer, Runtime, Mapping[str, Any]], Plan]


class Banded(NamedTuple):
    """The function of a technique that works on a band, and its plan: attribute `in_bands` of the public one."""

    function: Callable[..., Any]
    plan: Planner


def banded(plan: Planner) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Make a technique's function work in bands where it is called with `max_memory`."""

    def decorated(function: Callable[P, T]) -> Callable[P, T]:
        signature = inspect.signature(function)

        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> T:
            most = kwargs.get("max_memory")
            if most is None:
                return function(*args, **kwargs)
            most = memory_limit(most)
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

            made = plan(gbuffer, runtime, arguments)
            found = made.whole(in_bands(function, gbuffer, runtime, made, most), most)
            result: T = of_kind(found, kind_among((*args, *kwargs.values())))
            return result

        call.in_bands = Banded(function, plan)  # type: ignore[attr-defined]
        return call

    return decorated


def fixed_plan(computed: int = 0, images: Mapping[str, int] | None = None) -> Planner:
    """Return the plan of a technique that looks at the same rows round each pixel."""
    return lambda gbuffer, runtime, arguments: Plan(arguments, computed, images=images or {})


class ImageRows(Protocol):
    """A G-buffer whose rows are asked for.

    Attributes:
        size, margin, layers: as of `GBuffer`.
    """

    @property
    def size(self) -> tuple[int, int]: ...
    @property
    def margin(self) -> tuple[int, int]: ...
    @property
    def layers(self) -> int: ...
    def whole(self) -> GBuffer:
        """Return all of it."""

    def nearest(self, first: int, end: int) -> float:
        """Return the least depth of rows `first` to before `end` of the image, scene units; +inf of none."""

    def band(self, first: int, end: int, halo: int) -> GBuffer:
        """Return these rows, see `band_of`."""


@dataclass(frozen=True)
class RowsOf:
    """The rows of a G-buffer in memory, as `ImageRows`."""

    gbuffer: GBuffer

    @property
    def size(self) -> tuple[int, int]:
        return self.gbuffer.size

    @property
    def margin(self) -> tuple[int, int]:
        return self.gbuffer.margin

    @property
    def layers(self) -> int:
        return self.gbuffer.layers

    def whole(self) -> GBuffer:
        return self.gbuffer

    def nearest(self, first: int, end: int) -> float:
        depth: Any = self.gbuffer.first("depth")
        return float(depth[first + self.margin[0] : end + self.margin[0]].min(initial=np.inf))

    def band(self, first: int, end: int, halo: int) -> GBuffer:
        return band_of(self.gbuffer, first, end, halo)


class FoundRows(NamedTuple):
    """The result of a band: that of rows `first` to before `end`, an array or several."""

    first: int
    end: int
    found: Any


def in_bands(function: Callable[..., Any], gbuffer: GBuffer, runtime: Runtime, plan: Plan, most: int) -> Any:
    """Return the result of a technique's function, computed in bands. DeviceMemoryError: as `each_band`."""
    height, result = gbuffer.size[0], None
    for rows in each_band(function, RowsOf(gbuffer), runtime, plan, most):
        if rows.end - rows.first == height:
            return rows.found
        result = _gathered(result, rows, height)
    return result


def each_band(
    function: Callable[..., Any], image: ImageRows, runtime: Runtime, plan: Plan, most: int
) -> Iterator[FoundRows]:
    """Yield the results of a technique's function for as many bands as `most` bytes of device memory ask for.

    Raises:
        DeviceMemoryError: not even the lowest band fits.
    """
    height, first, halo = image.size[0], 0, 0
    rows = _first_guess(image, plan, most)
    may_grow = rows < height
    held = _emptied(runtime) if may_grow else 0
    while first < height:
        end = min(first + rows, height)
        try:
            with runtime.lock, at_most(runtime, most) as memory:
                work = _work(image, plan, first, end, halo)
                found = work.result(function, runtime)
                peak = memory.peak
        except DeviceMemoryError as error:
            if rows <= ALIGNED:
                raise DeviceMemoryError(
                    f"max_memory leaves {most} bytes to the device: a band of {end - first} rows does not fit with the "
                    f"rows that it reads round it; expected more, or a smaller radius ({error})"
                ) from error
            rows = fewer_rows(rows, height)
            halo, may_grow = 0, False
            continue
        yield FoundRows(first, end, found)
        first, halo = end, work.halo
        if may_grow:
            fitting = int(FILLED * (most - held) * work.rows / max(peak - held, 1)) - (work.rows - rows)
            rows, may_grow = max(rows, fitting // ALIGNED * ALIGNED), fitting > GROWN * rows


def _emptied(runtime: Runtime) -> int:
    """Let go of all that earlier calls left; return the bytes that objects hold."""
    memory = runtime.memory
    with runtime.lock:
        before, memory.limit = memory.limit, 0
        try:
            with suppress(DeviceMemoryError):
                runtime.exclusively(lambda: runtime.require(0, ""))
        finally:
            memory.limit = before
        return memory.used


@contextmanager
def at_most(runtime: Runtime, most: int) -> Iterator[DeviceMemory]:
    """Lower the limit of a device's memory, whose `peak` is meanwhile that of what is done within."""
    memory = runtime.memory
    before, peak = memory.limit, memory.peak
    memory.limit = min(before, most)
    try:
        try:
            # What earlier calls left goes, as far as it is in the way.
            runtime.exclusively(lambda: runtime.require(0, ""))
        except DeviceMemoryError as error:
            raise DeviceMemoryError(f"max_memory is {most}: expected more than what objects hold ({error})") from error
        memory.peak = memory.used
        yield memory
    finally:
        memory.limit, memory.peak = before, max(peak, memory.peak)


def _first_guess(image: ImageRows, plan: Plan, most: int) -> int:
    """Return rows of a band that may fit, a multiple of `ALIGNED`, or those of the image."""
    (height, columns), (above, aside) = image.size, image.margin
    rows = most // (PIXEL_BYTES * image.layers * (columns + 2 * aside)) - 2 * above
    if rows >= height:
        return height
    rows -= 2 * (plan.computed + int(min(plan.read(image.nearest(0, min(max(rows, 1), height))), height)))
    return max(rows // ALIGNED * ALIGNED, ALIGNED)


@dataclass(frozen=True)
class _Band:
    """A band, and what is to be done with it.

    Attributes:
        gbuffer: its rows, with those that are read round them.
        arguments: of the technique's function.
        kept: of the band's result.
        rows: of the arrays of the G-buffer.
        halo: see `band_of`.
    """

    gbuffer: GBuffer
    arguments: Mapping[str, Any]
    kept: slice
    rows: int
    halo: int

    def result(self, function: Callable[..., Any], runtime: Runtime) -> Any:
        """Return the rows that are kept of the function's result."""
        found = function(gbuffer=self.gbuffer, **self.arguments, runtime=runtime)
        return tuple(each[self.kept] for each in found) if isinstance(found, tuple) else found[self.kept]


def _work(image: ImageRows, plan: Plan, first: int, end: int, last_halo: int) -> _Band:
    """Return the band whose result holds rows `first` to before `end`; as high as the last one, if that will do."""
    height, margin = image.size[0], image.margin[0]
    if (first, end) == (0, height):
        return _Band(image.whole(), plan.arguments, slice(None), height + 2 * margin, 0)
    top, bottom = max(first - aligned(plan.computed), 0), min(end + aligned(plan.computed), height)
    halo = aligned(math.ceil(min(plan.read(image.nearest(top, bottom)), height + 2 * margin)))
    if halo <= last_halo <= SAME_HALO * halo:
        halo = last_halo
    arguments = dict(plan.arguments)
    for name, step in plan.images.items():
        given = arguments.get(name)
        # What is wrong with another one, the function says.
        if given is not None and np.shape(given)[:1] == (-(-height // step),):
            arguments[name] = host_array(given)[top // step : -(-bottom // step)]
    rows = bottom - top + 2 * (margin + halo)
    for name in plan.planes:
        given = arguments.get(name)
        if given is not None and np.ndim(given) >= 3:
            arguments[name] = rows_with_padding(host_array(given), np.ndim(given) - 3, top - halo, rows, 0.0)
    return _Band(image.band(top, bottom, halo), arguments, slice(first - top, end - top), rows, halo)


def memory_limit(value: object) -> int:
    """Return `max_memory`, bytes, checked. TypeError, ValueError: it is no whole number, or out of range."""
    return checks.integer("max_memory", value, low=LEAST_MEMORY, high=MOST_MEMORY, unit="bytes")


def fewer_rows(rows: int, height: int) -> int:
    """Return how many rows to try, a multiple of `ALIGNED`, where so many of an image's `height` did not fit."""
    return max(min(rows, height) * 2 // 3 // ALIGNED * ALIGNED, ALIGNED)


def aligned(rows: int) -> int:
    """Return a number of rows, rounded up to where patterns repeat."""
    return -(-rows // REPEATED) * REPEATED


def _gathered(result: Any, rows: FoundRows, height: int) -> Any:
    """Write the result of a band, an array or several, to that of the whole."""
    if isinstance(rows.found, tuple):
        before = result or (None,) * len(rows.found)
        pairs = zip(before, rows.found, strict=True)
        return tuple(_gathered(old, rows._replace(found=each), height) for old, each in pairs)
    if result is None:
        result = np.empty((height, *rows.found.shape[1:]), rows.found.dtype)
    result[rows.first : rows.end] = rows.found
    return result
