"""Pictures within a limit of memory: rendered in bands of rows that overlap, and are blended where they do."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from typing import Any, ParamSpec

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import DeviceMemoryError
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.result import Frame
from ssgi_cl.frame.skips import chosen_outputs
from ssgi_cl.frame.whole_call import WholeCall
from ssgi_cl.techniques.bands import ALIGNED, at_most, fewer_rows, memory_limit
from ssgi_cl.techniques.filters.tonemap import auto_exposure, tonemap

OVERLAP = 64
"""Rows that two bands have in common, on either side of where they meet. Each chooses its virtual point lights by
what itself shows; over these rows one choice fades into the other."""
PIXEL_BYTES = 160
"""Of device memory for a pixel of a picture: bands are tried with as many rows as then fit."""

P = ParamSpec("P")


def rendered_in_bands(render: Callable[P, Frame]) -> Callable[P, Frame]:
    """Make `render` work in bands where it is called with `max_memory`."""

    @wraps(render)
    def call(*args: P.args, **kwargs: P.kwargs) -> Frame:
        given: Any = kwargs.get("max_memory")
        if given is None:
            return render(*args, **kwargs)
        most = memory_limit(given)
        if kwargs.get("history") is not None:
            raise ValueError(f"max_memory is {most}: expected None with a history, which is of whole pictures")
        arguments, camera, params, runtime = WholeCall.of(render, args, kwargs, "max_memory")
        if params.gbuffer or "gbuffer" in (params.outputs or ()):
            raise ValueError(f"max_memory is {most}: expected no G-buffer in the frame, rasterize.gbuffer draws it")
        with runtime.lock, at_most(runtime, most):
            return _joined(_bands(render, arguments, params, runtime, most), camera, params, runtime, most)

    return call


def _bands(
    render: Callable[..., Frame], arguments: dict[str, Any], params: FrameParams, runtime: Runtime, most: int
) -> list[tuple[int, Frame]]:
    """Return the bands of a picture, and the first row of each; DeviceMemoryError: not even the lowest fits."""
    camera: Camera = arguments["camera"]
    height, found, first = camera.height, list[tuple[int, Frame]](), 0
    fitting = most // (PIXEL_BYTES * camera.width) - 2 * OVERLAP
    rows = _first_guess(height, fitting)
    outputs = chosen_outputs(params.outputs)
    if outputs is not None and "image" in outputs:
        arguments = {**arguments, "outputs": outputs - {"image"} | {"radiance"}}
    while first < height:
        top, bottom = max(first - OVERLAP, 0), min(first + rows + OVERLAP, height)
        part = camera if (top, bottom) == (0, height) else camera.cropped(0, top, camera.width, bottom - top)
        try:
            found.append((top, render(**{**arguments, "camera": part})))
        except DeviceMemoryError as error:
            if rows <= ALIGNED:
                raise DeviceMemoryError(
                    f"max_memory is {most}: a band of {bottom - top} rows does not fit beside the scene and its "
                    f"maps; expected more ({error})"
                ) from error
            rows = fewer_rows(rows, height)
            runtime.forget()
            continue
        first += rows
    return found


def _first_guess(height: int, fitting: int) -> int:
    """Return rows of a band, a multiple of `ALIGNED`, where so many fit beside those that bands share."""
    return height if fitting + 2 * OVERLAP >= height else max(fitting // ALIGNED * ALIGNED, ALIGNED)


def _joined(
    bands: Sequence[tuple[int, Frame]], camera: Camera, params: FrameParams, runtime: Runtime, most: int
) -> Frame:
    """Return the picture of bands, tone-mapped as one."""
    outputs = chosen_outputs(params.outputs) or {"image", "radiance"}
    radiance = _blended(bands, "_radiance", camera.size)
    exposure, image = params.exposure or 1.0, None
    if radiance is not None:
        exposure = params.exposure or auto_exposure(radiance)
        if "image" in outputs:
            image = tonemap(radiance, exposure=exposure, curve=params.curve, max_memory=most, runtime=runtime)
    return replace(
        bands[-1][1],
        ao=_blended(bands, "ao", camera.size),
        indirect=_blended(bands, "indirect", camera.size),
        exposure=exposure,
        passes=tuple(each for _, frame in bands for each in frame.passes),
        wall_ms=sum(frame.wall_ms for _, frame in bands),
        _image=image,
        _radiance=radiance if "radiance" in outputs else None,
    )


def _blended(bands: Sequence[tuple[int, Frame]], name: str, size: tuple[int, int]) -> NDArray[np.float32] | None:
    """Return an array of the whole picture; rows that two bands have fade from one to the other."""
    result: NDArray[np.float32] | None = None
    end = 0  # of the rows that are there
    for top, frame in bands:
        part: NDArray[np.float32] | None = getattr(frame, name)
        if part is None:
            return None
        if result is None:
            result = np.empty((*size, *part.shape[2:]), np.float32)
        common = max(end - top, 0)
        weight = ((np.arange(common, dtype=np.float32) + 0.5) / max(common, 1)).reshape(-1, *[1] * (part.ndim - 1))
        result[top:end] += weight * (part[:common] - result[top:end])
        result[top + common : top + len(part)] = part[common:]
        end = top + len(part)
    return result
