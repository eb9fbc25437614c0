"""Pictures of several samples a pixel: the mean of frames at places within the pixel, each with other patterns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from time import perf_counter
from typing import Any, ParamSpec

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import LARGEST_SIZE
from ssgi_cl.core.pixel_places import pixel_places
from ssgi_cl.device.progress import Progress, part_of, told
from ssgi_cl.device.timing import PassTime
from ssgi_cl.frame.history import PATTERN, pattern_shift
from ssgi_cl.frame.result import Frame
from ssgi_cl.frame.skips import chosen_outputs
from ssgi_cl.frame.whole_call import WholeCall
from ssgi_cl.techniques.filters.tonemap import auto_exposure, tonemap

MOST_SAMPLES = 1024
ENOUGH = 8
"""Samples from which on they alone smooth edges by default: with both, FLIP is .0439 in `terrace` at 400 x 300 with 8,
without the places of each frame .0432; with 4 it is .0439 and .0449."""

P = ParamSpec("P")


def mean_of_samples(render: Callable[P, Frame]) -> Callable[P, Frame]:
    """Make `render` return the mean of several frames where it is called with `samples`."""

    @wraps(render)
    def call(*args: P.args, **kwargs: P.kwargs) -> Frame:
        given: Any = kwargs.get("samples", 1)
        progress: Any = kwargs.get("progress")
        samples = checks.integer("samples", given, low=1, high=MOST_SAMPLES, unit="samples a pixel")
        if samples == 1:
            return render(*args, **kwargs)
        if kwargs.get("history") is not None:
            raise ValueError(f"samples is {samples}: expected 1 with a history, whose frames are samples themselves")
        whole = WholeCall.of(render, args, kwargs, "samples", "progress")
        if max(whole.camera.size) > LARGEST_SIZE - PATTERN + 1:
            raise ValueError(
                f"samples is {samples}: expected 1 with an image of {whole.camera.size} pixels (rows, columns), whose "
                f"sides exceed {LARGEST_SIZE - PATTERN + 1}"
            )
        with whole.runtime.lock:
            return _mean(render, whole, samples, progress)

    return call


def shifts(samples: int) -> tuple[tuple[float, float, int, int], ...]:
    """Return for each sample (right, down) from the pixel's centre in pixels, and the columns and rows by which its
    image begins before the picture, so that patterns lie elsewhere."""
    places = pixel_places(samples) - 0.5
    return tuple((float(right), float(down), *pattern_shift(i)) for i, (right, down) in enumerate(places))


def _mean(render: Callable[..., Frame], whole: WholeCall, samples: int, progress: Progress) -> Frame:
    """Return the picture of several samples a pixel, tone-mapped as one."""
    start = perf_counter()
    arguments, camera, params, runtime = whole
    outputs = chosen_outputs(params.outputs)
    pictures = {"image", "radiance"} if outputs is None else set(outputs) - {"gbuffer"}
    inner = None if outputs is None else {"radiance"} | (pictures - {"image"})
    edges = 0 if params.edges is None and samples >= ENOUGH else params.edges
    arguments = {**arguments, "outputs": inner, "gbuffer": False, "edges": edges}
    rows, columns = camera.size
    sums: dict[str, NDArray[np.float64]] = {}
    last: Frame | None = None
    passes: list[PassTime] = []
    with told(progress, "rendering") as tell:
        for number, (right, down, before, above) in enumerate(shifts(samples) if pictures else ()):
            part = camera.cropped(right - before, down - above, columns + PATTERN - 1, rows + PATTERN - 1)
            step = part_of(tell, number / samples, (number + 1) / samples)
            last = render(**{**arguments, "camera": part}, progress=step)
            passes.extend(last.passes)
            for name in ("_radiance", "ao", "indirect"):
                plane = getattr(last, name)
                if plane is not None:
                    shown = plane[above : above + rows, before : before + columns]
                    sums[name] = sums.get(name, 0.0) + shown.astype(np.float64)
        means = {name: (total / samples).astype(np.float32) for name, total in sums.items()}
        surfaces = params.gbuffer or "gbuffer" in (outputs or ())
        seen = None
        if surfaces:
            seen = render(**{**arguments, "camera": camera, "outputs": ("gbuffer",), "gbuffer": True})
    frame = last or seen
    assert frame is not None  # noqa: S101  there is an output
    radiance, exposure, image = means.get("_radiance"), params.exposure or 1.0, None
    if radiance is not None:
        exposure = params.exposure or auto_exposure(radiance)
        if "image" in pictures:
            image = tonemap(radiance, exposure=exposure, curve=params.curve, runtime=runtime)
    return replace(
        frame,
        ao=means.get("ao"),
        indirect=means.get("indirect"),
        gbuffer=None if seen is None else seen.gbuffer,
        levels=None if seen is None else seen.levels,
        exposure=exposure,
        passes=tuple(passes) if passes else frame.passes,
        wall_ms=(perf_counter() - start) * 1e3,
        _image=image,
        _radiance=radiance if outputs is None or "radiance" in outputs else None,
    )
