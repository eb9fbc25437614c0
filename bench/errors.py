"""Errors of a result against a truth, as numbers for tables and pages."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.core.srgb import srgb_to_linear
from ssgi_cl.techniques.filters.tonemap import auto_exposure
from ssgi_cl.truth import Truth, metrics

SHOULDER = 0.25
"""Of the tone curve y = x / (1 + SHOULDER x)."""
GAMMA = 2.2

PEAK_SHARE = 99.9
"""Per cent of the truth's values that its peak exceeds: of light, which has no greatest value."""


def errors_of(
    image: NDArray[np.float32],
    truth: Truth,
    seen: NDArray[np.bool_],
    regions: dict[str, NDArray[np.bool_]],
    *,
    light: bool,
    picture: bool = False,
    smooth: NDArray[np.bool_] | None = None,
) -> dict[str, Any]:
    """Return metric -> number over the pixels that show a surface.

    Args:
        image: [rows, columns] or [rows, columns, 3].
        truth: of the same shape; NaN in pixels of which it is not known.
        seen: [rows, columns], where something is to be compared.
        regions: what `metrics.regions` returns.
        light: the values have no greatest one, as those of A have: FLIP is HDR-FLIP, and the peak
            of PSNR and SSIM is what 99.9 % of the truth's values do not exceed, in place of 1.
        picture: they are radiance of a frame: FLIP is that of `picture_flip`.
        smooth: what `metrics.smooth_surfaces` returns, for streaks and for the mottling of a frame.

    Returns:
        rmse, bias, p99, psnr, mrse, ssim and flip (None if flip-evaluator is not installed; of a
        truth that is black all over, so are mrse, psnr and ssim; of one with holes, ssim and flip),
        mottling (None of what is no frame, and where nothing that is lit is `smooth`), streaks (None
        where nothing is `smooth`, or the truth is of too few samples to know its error),
        `mean` of the truth and `truth_error`, the root mean square of its standard error, and
        `regions`: share of the pixels, rmse and bias of each region that has any.
    """
    mean = truth.mean
    known = np.isfinite(mean if mean.ndim == 2 else mean.sum(axis=-1))
    whole = bool(known[seen].all())
    shares = {name: float(mask.sum() / seen.sum()) for name, mask in regions.items()}
    seen = seen & known
    peak = float(np.percentile(mean[seen], PEAK_SHARE)) if light else 1.0
    result: dict[str, Any] = {
        "rmse": metrics.rmse(image, mean, seen),
        "bias": metrics.bias(image, mean, seen),
        "p99": metrics.p99(image, mean, seen),
        "mrse": metrics.mrse(image, mean, seen) if peak > 0.0 else None,
        "psnr": metrics.psnr(image, mean, seen, peak=peak) if peak > 0.0 else None,
        "ssim": metrics.ssim(image, mean, seen, peak=peak) if peak > 0.0 and whole else None,
        "flip": _flip(image, mean, seen, light=light, picture=picture) if peak > 0.0 and whole else None,
        "mottling": _mottling(image, mean, smooth, known) if picture and smooth is not None else None,
        "streaks": _streaks(image, truth, smooth, seen) if smooth is not None else None,
        "mean": float(mean[seen].mean(dtype=np.float64)),
        "truth_error": math.sqrt(float(np.mean(truth.error[seen].astype(np.float64) ** 2))),
        "regions": {
            name: {
                "share": shares[name],
                "rmse": metrics.rmse(image, mean, mask & known),
                "bias": metrics.bias(image, mean, mask & known),
            }
            for name, mask in regions.items()
            if (mask & known).any()
        },
    }
    return result


def picture_flip(radiance: NDArray[np.floating], truth: NDArray[np.floating]) -> float:
    """Return mean LDR-FLIP (Andersson et al. 2020) of radiance [rows, columns, 3] as a screen shows it.

    Both get the truth's exposure, the tone curve y = x / (1 + x / 4) and gamma 2.2.

    Raises:
        MissingExtraError: flip-evaluator is not installed.
    """
    exposure = auto_exposure(np.asarray(truth, np.float32))
    # FLIP wants linear light: what a screen makes of the encoded picture.
    shown = [srgb_to_linear(on_screen(image, exposure)) for image in (radiance, truth)]
    return metrics.flip(shown[0], shown[1])


def on_screen(radiance: NDArray[np.floating], exposure: float) -> NDArray[np.float64]:
    """Return the picture in [0, 1]: exposure, y = x / (1 + x / 4), clipped, gamma 2.2."""
    light = np.maximum(np.asarray(radiance, np.float64), 0.0) * exposure
    curve: NDArray[np.float64] = np.clip(light / (1.0 + SHOULDER * light), 0.0, 1.0) ** (1.0 / GAMMA)
    return curve


def _mottling(
    image: NDArray[np.float32], mean: NDArray[np.float32], smooth: NDArray[np.bool_], known: NDArray[np.bool_]
) -> float | None:
    counted = smooth & known
    return metrics.mottling(image, mean, counted) if mean[counted].any() else None


def _streaks(
    image: NDArray[np.float32], truth: Truth, smooth: NDArray[np.bool_], seen: NDArray[np.bool_]
) -> float | None:
    counted = smooth & seen
    if not counted.any():
        return None
    noise = math.sqrt(float(np.mean(truth.error[counted].astype(np.float64) ** 2)))
    if not math.isfinite(noise):  # the truth is of too few samples to tell
        return None
    return metrics.streaks(image, truth.mean, counted, noise=noise)


def _flip(
    image: NDArray[np.float32], mean: NDArray[np.float32], seen: NDArray[np.bool_], *, light: bool, picture: bool
) -> float | None:
    try:
        if picture:
            return picture_flip(image, mean)
        return (metrics.hdr_flip if light else metrics.flip)(image, mean, seen)
    except MissingExtraError:
        return None  # the document's versions say that it is not installed
