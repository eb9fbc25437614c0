"""Tone mapping: linear radiance to an sRGB picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.names import Curve
from ssgi_cl.core.params import Params, Prepared, param
from ssgi_cl.device.active_region import Region, copy_region
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.techniques.bands import memory_limit
from ssgi_cl.techniques.technique import Bench, Technique

CURVES = get_args(Curve)
MIDDLE_GREY = 0.18
HIGHLIGHT = 0.95
"""Share of the pixels with light that are at most as bright as the highlight."""
DARKEST = 1.0 / 32.0
"""Share of the highlight as which darker pixels count: 5 stops. In none of ten scenes with usual lights does this
change the exposure by more than 11 %, and by more than 3 % in two."""
BRIGHTEST = 2.5
"""What the exposure makes of the highlight, at most: it is 246 of 255 by the filmic curve, and 3.5 is 250."""
LARGEST_EXPOSURE = 1e30
"""Greater ones count as this one, which is finite in float32."""

PIXEL_BYTES = 32
"""Of device memory for a pixel, three floats in and three numbers out, and room."""


@dataclass(frozen=True, kw_only=True)
class TonemapParams(Params):
    """Parameters of tone mapping (Narkowicz 2015; Reinhard et al. 2002)."""

    curve: Curve = param(
        "filmic", "fit of the ACES reference transform, or 'clip': what exceeds 1 is cut", choices=CURVES
    )
    exposure: float | None = param(
        None,
        "factor before the curve, above 0; by default the log-average luminance becomes 0.18, see `auto_exposure`",
        shape=lambda _: None,
    )
    bits: int = param(8, "bits of each channel of the picture, 8 or 16", low=8, high=16)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bits not in (8, 16):
            raise ValueError(f"bits is {self.bits}: expected 8 or 16 bits a channel")
        if self.exposure is not None:
            exposure = checks.number("exposure", self.exposure, low=0.0, above=True)
            object.__setattr__(self, "exposure", exposure)


class Tonemap(Prepared[TonemapParams]):
    """Tone mapping, prepared for images of one size.

    Narkowicz 2015; Reinhard et al. 2002. Departs: see `tonemap`.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        params: see `TonemapParams`.
    """

    def __init__(self, runtime: Runtime, size: Size, params: TonemapParams | None = None) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params or TonemapParams()
        number = CURVES.index(self._params.curve)
        self._kernel = runtime.kernel(
            "filters/tonemap.cl", {"TONEMAP_CURVE": number, "TONEMAP_BITS": self._params.bits}
        )
        self._pitch = (size[1] + 15) // 16 * 16

    def run(
        self, radiance: Plane, *, exposure: float | None = None, region: Region | None = None
    ) -> NDArray[np.uint8 | np.uint16]:
        """Run the pass; return the picture, [rows, columns, 3] uint8 or uint16.

        `exposure` is that of the parameters by default, or the automatic one of the radiance.
        Outside of `region` radiance is the same everywhere: one pixel stands for all.
        """
        exposure = self.params.exposure if exposure is None else exposure
        if exposure is None:
            exposure = auto_exposure(np.moveaxis(radiance.download(), 0, -1), region)
        beyond = None if region is None else region.beyond(self.size)
        parts = [region]
        kind = np.uint8 if self._params.bits == 8 else np.uint16
        words = self.size[0] * self._pitch * 3 * self._params.bits // 32
        encoded_bytes = self.runtime.transient.array(words, np.uint32)
        if beyond is not None:
            parts.append(Region(*beyond, 1, 1))
        for part in parts:
            self._kernel.run(
                self.size,
                region=part,
                radiance=radiance,
                encoded=encoded_bytes,
                exposure=min(exposure, LARGEST_EXPOSURE),
            )
        rows, columns = self.size
        picture = np.empty((rows, columns, 3), kind)
        with encoded_bytes.mapped() as flat:
            encoded = flat.view(kind).reshape(rows, self._pitch, 3)[:, :columns]
            copy_region(encoded, picture, region, beyond)
        return picture


def auto_exposure(radiance: NDArray[np.float32], region: Region | None = None) -> float:
    """Return the exposure that brings the log-average luminance to middle grey (Reinhard 2002), or less.

    The highlight is what 95 % of the pixels with light do not exceed. Luminances are clipped to between
    1/32 of it and itself before their average, so that neither what is all but black nor small lights
    decide, and the exposure is at most 2.5 over the highlight, so that at most 5 % become white.

    Args:
        radiance: [rows, columns, 3], linear, any strides. Pixels of luminance 0 don't count; 1 if
            all are 0.
        region: pixels outside of which all are the same; this changes no bit.
    """
    # Every third row and column: the mean of a log changes by less than the eye can tell.
    picked = radiance[::3, ::3]
    beyond = None if region is None else region.beyond(radiance.shape[:2])
    if region is None or beyond is None:
        logs = _log_luminance(picked)
    else:
        logs = np.full(picked.shape[:2], _log_luminance(radiance[beyond][None, None])[0, 0])
        part = region.reduced(3)
        places = slice(part.row, part.end[0]), slice(part.column, part.end[1])
        logs[places] = _log_luminance(picked[places])
    lit = logs[logs > -np.inf]
    if lit.size == 0:
        return 1.0
    highest = int(np.ceil(HIGHLIGHT * lit.size)) - 1
    highlight = float(np.partition(lit, highest)[highest])
    average = float(np.clip(lit, highlight + np.log(DARKEST), highlight).mean())
    logs_of_exposure = min(np.log(MIDDLE_GREY) - average, np.log(BRIGHTEST) - highlight)
    return float(np.clip(np.exp(logs_of_exposure), 1e-12, 1e12))


def _log_luminance(radiance: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the logarithm of each pixel's luminance, -inf of 0 and nan below; no bit of it depends
    on other pixels."""
    luminance = np.zeros(radiance.shape[:2])
    for channel, weight in enumerate((0.2126, 0.7152, 0.0722)):
        luminance += np.multiply(radiance[..., channel], weight, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(luminance)


@serialised
def tonemap(
    radiance: ArrayLike,
    *,
    exposure: float | None = None,
    curve: Curve = "filmic",
    bits: int = 8,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
) -> NDArray[Any]:
    """Turn linear radiance into an sRGB picture.

    The filmic curve is the fit of the ACES reference transform by Narkowicz 2015; automatic
    exposure is the log-average of Reinhard et al. 2002, "Photographic Tone Reproduction for Digital
    Images". Departs: in that average pixels that are black don't count, others are clipped to 5 stops
    below the 95th percentile, and at most 5 % of the pixels become white.

    Args:
        radiance: [rows, columns, 3] float32, finite, >= 0.
        exposure: factor before the curve, > 0; by default the log-average luminance becomes 0.18, or
            less where more than 5 % of the pixels would be white.
        curve: "filmic" (Narkowicz 2015) or "clip" (only what exceeds 1 is cut).
        bits: 8 or 16, of each channel.
        max_memory: as of `gtao`; the automatic exposure is that of the whole image.
        runtime: the device; by default the fastest found.

    Returns:
        [rows, columns, 3] uint8 or uint16, sRGB encoding.

    Raises:
        TypeError, ValueError: an argument of the wrong type, shape or range.
    """
    values = checks.plane("radiance", radiance, channels=3, low=0.0, unit="W m^-2 sr^-1")
    if values.size == 0:
        raise ValueError(f"radiance has shape {values.shape}: expected at least one pixel")
    params = TonemapParams(curve=curve, exposure=exposure, bits=bits)
    factor = auto_exposure(values) if params.exposure is None else params.exposure
    device = runtime or Runtime.open()
    size = values.shape[:2]
    if max_memory is not None:
        rows = max(memory_limit(max_memory) // (PIXEL_BYTES * (size[1] + 32)), 1)
        if rows < size[0]:
            starts = range(0, size[0], rows)
            parts = [
                tonemap(values[i : i + rows], exposure=factor, curve=curve, bits=bits, runtime=device) for i in starts
            ]
            return np.concatenate(parts)
    technique, plane = device.prepared(
        (Tonemap, size, params.shape()), lambda: (Tonemap(device, size, params), device.plane(3, size))
    )
    technique.params = params
    plane.upload(np.moveaxis(values, -1, 0))
    with device.frame():
        result: NDArray[Any] = technique.run(plane, exposure=factor)
        return result


DESCRIPTOR = Technique(
    name="tonemap",
    kind="shading",
    paper="Narkowicz 2015; Reinhard et al. 2002",
    function=tonemap,
    params=TonemapParams,
    technique=Tonemap,
    reference="ssgi_cl.reference.filters.tonemap",
    reads=("image",),
    writes=("image",),
    bench=Bench(rows={"tonemap": ("exposure, filmic curve, sRGB", ())}),
)
