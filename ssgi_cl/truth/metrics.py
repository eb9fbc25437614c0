"""Metrics of the error of an image against its truth, over the pixels that count.

Images are [rows, columns] or [rows, columns, 3] in linear light. Of the mask [rows, columns] only
pixels that are True count; without one, all do. The truth comes second.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.core.vpls import LUMINANCE
from ssgi_cl.truth.image_regions import REGIONS, Mask, connected, regions, smooth_surfaces

__all__ = [
    "PIXELS_PER_DEGREE",
    "REGIONS",
    "bias",
    "flip",
    "hdr_flip",
    "mottling",
    "mrse",
    "p99",
    "psnr",
    "regions",
    "rmse",
    "smooth_surfaces",
    "ssim",
    "streaks",
]


def __dir__() -> list[str]:
    return __all__


Doubles = NDArray[np.float64]

PIXELS_PER_DEGREE = 67.02
"""Of FLIP: a display 0.7 m wide with 3840 columns, seen from 0.7 m."""

NARROW, WIDE = 2.0, 20.0
"""Standard deviations in pixels of the Gaussians between which errors count as mottling: noise of single pixels is
narrower, a light that is too bright all over is wider."""
EVEN = 8.0
"""Standard deviation in pixels of the Gaussian mean that is taken from errors before streaks are looked for: half of a
wave of 43 pixels is left."""
APART = range(8, 24)
"""Pixels between two that streaks are looked for in: beyond what a blur of 5 x 5 makes alike; whole periods."""
PERIODS = (4, 8)
"""Of patterns of sampling, pixels."""
DIRECTIONS = ((0, 1), (1, 0), (1, 1), (1, -1))
"""Steps of rows and columns: along rows, along columns, and both diagonals, each beside the one across it."""
CHANCE = 3.0
"""Standard deviations of what the truth's own noise shows by chance."""
DARK = 0.01
"""Of the truth's mean luminance: what is added to luminances before their logarithm."""


def rmse(image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return the root of the mean squared difference.

    Args:
        image, truth: [rows, columns] or [rows, columns, channels] values of any unit.
        mask: [rows, columns] bool, True where pixels count; by default all do.
    """
    value, reference = _counted(image, truth, mask)
    return math.sqrt(float(np.mean((value - reference) ** 2)))


def bias(image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return the mean difference, > 0 where the image is too bright.

    Args:
        image, truth, mask: as in `rmse`.
    """
    value, reference = _counted(image, truth, mask)
    return float(np.mean(value - reference))


def p99(image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return the absolute difference that 99 % of all values do not exceed.

    Args:
        image, truth, mask: as in `rmse`.
    """
    value, reference = _counted(image, truth, mask)
    return float(np.percentile(np.abs(value - reference), 99.0))


def psnr(image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None, *, peak: float = 1.0) -> float:
    """Return 20 log10(peak / rmse) in dB; infinite where nothing differs.

    Args:
        image, truth, mask: as in `rmse`.
        peak: the largest value of a signal, > 0: 1 for occlusion.
    """
    peak = checks.number("peak", peak, low=0, above=True)
    error = rmse(image, truth, mask)
    return 20.0 * math.log10(peak / error) if error > 0.0 else math.inf


def mrse(image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None) -> float:
    """Return the mean of (v - r)^2 / (r + 0.01)^2 with the value v and the truth r >= 0.

    Args:
        image, truth, mask: as in `rmse`.
    """
    value, reference = _counted(image, truth, mask)
    if (reference < 0.0).any():
        raise ValueError(f"truth holds {reference.min():g}: expected numbers >= 0")
    return float(np.mean(((value - reference) / (reference + 0.01)) ** 2))


def ssim(image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None, *, peak: float = 1.0) -> float:
    """Return the mean structural similarity (Wang et al. 2004), 1 where nothing differs.

    Windows of 11 x 11 with Gaussian weights (sigma 1.5) round each pixel that counts; pixels that
    don't, and those outside the image, have no weight in them. K1 = 0.01, K2 = 0.03.

    Args:
        image, truth, mask: as in `rmse`.
        peak: range of the values, > 0: 1 for occlusion.
    """
    peak = checks.number("peak", peak, low=0, above=True)
    value, reference, where = _images(image, truth, mask)
    weight = where[..., None].astype(np.float64)
    value, reference = np.where(weight > 0.0, value, 0.0), np.where(weight > 0.0, reference, 0.0)
    total = np.maximum(_regional(weight), 1e-300)

    def mean(values: Doubles) -> Doubles:
        average: Doubles = _regional(values * weight) / total
        return average

    # About the middle of the values, so that variances do not cancel.
    middle = float(reference[where].mean())
    v, r = value - middle, reference - middle
    mean_v, mean_r = mean(v), mean(r)
    variances = mean(v * v) - mean_v**2 + mean(r * r) - mean_r**2
    covariance = mean(v * r) - mean_v * mean_r
    mean_v, mean_r = mean_v + middle, mean_r + middle
    c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
    similarity = (2.0 * mean_v * mean_r + c1) * (2.0 * covariance + c2)
    similarity /= (mean_v**2 + mean_r**2 + c1) * (variances + c2)
    return float(similarity[where].mean())


def flip(
    image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None, *, pixels_per_degree: float = PIXELS_PER_DEGREE
) -> float:
    """Return the mean FLIP (Andersson et al. 2020) of values that are clipped to [0, 1].

    Where the mask is False the image is shown as the truth, so that nothing differs there.

    Args:
        image, truth, mask: as in `rmse`.
        pixels_per_degree: of the viewer's field of view, > 0.

    Raises:
        MissingExtraError: flip-evaluator is not installed; it comes with the extra `truth`.
    """
    return _flip(image, truth, mask, pixels_per_degree, "LDR")


def hdr_flip(
    image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None = None, *, pixels_per_degree: float = PIXELS_PER_DEGREE
) -> float:
    """Return the mean HDR-FLIP (Andersson et al. 2021) of radiances >= 0; otherwise like `flip`.

    Exposures follow from the truth; the tone curve is ACES.

    Args:
        image, truth, mask: as in `rmse`.
        pixels_per_degree: as in `flip`.
    """
    return _flip(image, truth, mask, pixels_per_degree, "HDR")


def mottling(image: ArrayLike, truth: ArrayLike, smooth: ArrayLike) -> float:
    """Return the root mean square of blotches, as a share of the light: 0.05 is 5 %.

    The error of a pixel is the natural logarithm of the image's luminance over the truth's, both
    averaged with a Gaussian of 2 pixels and with 1 % of the truth's mean added. From it its own mean
    over a Gaussian of 20 pixels is subtracted. Waves of length w pixels keep exp(-2 (2 pi / w)^2) -
    exp(-200 (2 pi / w)^2) of their amplitude: half or more from 11 to 107 pixels. Gaussians do not
    reach beyond the smooth surface that a pixel belongs to: pixels of `smooth` that share sides.

    Args:
        image, truth: [rows, columns] or [rows, columns, 3] linear light >= 0, finite where `smooth`.
        smooth: [rows, columns] bool: see `smooth_surfaces`.
    """
    value, reference, where = _images(image, truth, smooth)
    lights = []
    for name, array in (("image", value), ("truth", reference)):
        weights = LUMINANCE if array.shape[2] == 3 else np.ones(1)
        light: Doubles = np.where(where, np.where(where[..., None], array, 0.0) @ weights, 0.0)
        if light.min() < 0.0:
            raise ValueError(f"{name} has a luminance of {light.min():g}: expected numbers >= 0")
        lights.append(light)
    floor = DARK * float(lights[1][where].mean())
    if floor == 0.0:
        raise ValueError("truth is black where smooth is True: expected light, of which errors are a share")
    total = 0.0
    for region, own in connected(where):
        narrow = [_blurred(light[region], own, NARROW) + floor for light in lights]
        error = np.log(narrow[0] / narrow[1])
        # Both Gaussians one after the other are as wide as `WIDE`.
        even = _blurred(error, own, math.sqrt(WIDE**2 - NARROW**2))
        total += float(np.sum((error - even)[own] ** 2))
    return math.sqrt(total / int(where.sum()))


def streaks(image: ArrayLike, truth: ArrayLike, smooth: ArrayLike, *, noise: float = 0.0) -> float:
    """Return the root mean square of errors that repeat along a line, in the unit of the images.

    From the error its mean over a Gaussian of 8 pixels is subtracted. C(d) is the mean product of what is
    left of two pixels of a smooth surface that lie d apart. Three kinds of structure are looked for, at
    distances of 8 to 23 pixels, beyond which blurred noise is alike; the strongest counts:

    - stripes along rows, columns or a diagonal: C along them, less C across them where that is positive,
      as of blotches, which are alike in both;
    - patterns of period p = 4 or 8 along rows or columns: C at multiples of p, less its mean elsewhere,
      times (p - 1) / p.

    White noise and blotches have none. Of stripes of length w from one to the next exp(-32 (2 pi / w)^2) is
    lost to the Gaussian: half at 43 pixels.

    Args:
        image, truth: as in `rmse`; of [rows, columns, 3] the luminance.
        smooth: [rows, columns] bool: see `smooth_surfaces`; pixels that share sides are one surface.
        noise: standard error of the truth in a pixel, root mean square, >= 0: what it makes by chance, three
            standard deviations of C, does not count.
    """
    noise = checks.number("noise", noise, low=0.0)
    value, reference, where = _images(image, truth, smooth)
    error: Doubles = np.zeros(where.shape)
    labels = np.zeros(where.shape, np.int32)
    weights = LUMINANCE if value.shape[2] == 3 else np.ones(1)
    raw = np.where(where[..., None], value, 0.0) @ weights - np.where(where[..., None], reference, 0.0) @ weights
    for number, (region, own) in enumerate(connected(where), start=1):
        labels[region][own] = number
        error[region][own] = (raw[region] - _blurred(raw[region], own, EVEN))[own]
    alike = {step: _products(error, labels, step) for step in DIRECTIONS}
    found = [0.0]
    for along, across in ((0, 1), (1, 0), (2, 3), (3, 2)):
        (mine, count), (others, other_count) = alike[DIRECTIONS[along]], alike[DIRECTIONS[across]]
        if count.any() and other_count.any():
            chance = CHANCE * noise**2 / math.sqrt(float(count.sum()))
            found.append(_mean(mine, count) - max(0.0, _mean(others, other_count)) - chance)
    for period in PERIODS:
        repeats = np.array([distance % period == 0 for distance in APART])
        for products, count in (alike[step] for step in DIRECTIONS[:2]):
            if count[repeats].all():
                chance = CHANCE * noise**2 / math.sqrt(float(count[repeats].sum()))
                other_mean = _mean(products[~repeats], count[~repeats])
                share = (period - 1) / period
                found.append(share * (_mean(products[repeats], count[repeats]) - other_mean) - chance)
    return math.sqrt(max(found))


def _counted(image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None) -> tuple[Doubles, Doubles]:
    value, reference, where = _images(image, truth, mask)
    return value[where], reference[where]


def _images(image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None) -> tuple[Doubles, Doubles, Mask]:
    """Return both as [rows, columns, channels] float64, and the mask."""
    arrays = []
    for name, given in (("image", image), ("truth", truth)):
        array = checks.floats(name, given, np.float64)
        if array.ndim == 2:
            array = array[..., None]
        if array.ndim != 3 or array.shape[2] not in (1, 3):
            raise ValueError(f"{name} has shape {np.shape(given)}: expected (rows, columns) or (rows, columns, 3)")
        arrays.append(array)
    value, reference = arrays
    if value.shape != reference.shape:
        raise ValueError(f"image has shape {np.shape(image)}: expected {np.shape(truth)} as the truth")
    where = np.ones(value.shape[:2], np.bool_) if mask is None else checks.as_array("mask", mask)
    if where.dtype != np.bool_:
        raise TypeError(f"mask has dtype {where.dtype}: expected bool")
    if where.shape != value.shape[:2]:
        raise ValueError(f"mask has shape {where.shape}: expected {value.shape[:2]} as the image")
    if not where.any():
        raise ValueError("mask is False everywhere: expected at least one pixel that counts")
    for name, array in (("image", value), ("truth", reference)):
        wrong = ~np.isfinite(array).all(axis=-1) & where
        if wrong.any():
            row, column = (int(i) for i in np.argwhere(wrong)[0])
            raise ValueError(
                f"{name}[{row}, {column}] is {array[row, column].tolist()}: expected finite "
                "numbers where the mask is True"
            )
    return value, reference, where


def _regional(values: Doubles) -> Doubles:
    """Return Gaussian sums of [rows, columns, channels] over 11 x 11; zero outside."""
    offset = np.arange(-5, 6)
    weights = np.exp(-0.5 * (offset / 1.5) ** 2)
    weights /= weights.sum()
    for axis in (0, 1):
        padding = [(0, 0)] * 3
        padding[axis] = (5, 5)
        padded = np.pad(values, padding)
        size = values.shape[axis]
        pieces = (np.take(padded, np.arange(k, k + size), axis=axis) for k in range(11))
        values = np.asarray(sum(w * piece for w, piece in zip(weights, pieces, strict=True)))
    return values


def _flip(
    image: ArrayLike, truth: ArrayLike, mask: ArrayLike | None, pixels_per_degree: float, dynamic_range: str
) -> float:
    density = checks.number("pixels_per_degree", pixels_per_degree, low=0, above=True)
    value, reference, where = _images(image, truth, mask)
    counted = reference[where]
    if dynamic_range == "HDR" and min(counted.min(), value[where].min()) < 0.0:
        raise ValueError("image or truth holds a negative radiance: expected numbers >= 0")
    if dynamic_range == "HDR" and counted.max() <= 0.0:
        raise ValueError("truth is black: expected light, from which exposures follow")
    # What doesn't count is the same in both; a value inside the range leaves the exposures alone.
    fill = float(np.median(counted))
    shown = [
        np.ascontiguousarray(np.broadcast_to(np.where(where[..., None], array, fill), (*where.shape, 3)), np.float32)
        for array in (reference, value)
    ]
    if dynamic_range == "LDR":
        shown = [np.clip(array, 0.0, 1.0) for array in shown]
    try:
        from flip_evaluator import evaluate
    except ImportError as error:
        raise MissingExtraError(
            "FLIP needs flip-evaluator, which is not installed: pip install 'ssgi-cl[truth]'"
        ) from error
    parameters: dict[str, Any] = {"ppd": density}
    error_map, _, _ = evaluate(
        *shown, dynamic_range, inputsRGB=False, applyMagma=False, computeMeanError=False, parameters=parameters
    )
    errors = np.asarray(error_map, np.float64).reshape(*where.shape, -1)[..., 0]
    return float(errors[where].mean())


def _blurred(values: Doubles, own: Mask, width: float) -> Doubles:
    """Return Gaussian means of the pixels of `own`; elsewhere numbers of no use."""
    from scipy.ndimage import gaussian_filter

    sums, weights = (
        gaussian_filter(np.where(own, part, 0.0), width, mode="constant") for part in (values, np.ones_like(values))
    )
    mean: Doubles = np.where(own, sums / np.maximum(weights, 1e-300), 0.0)
    return mean


def _products(error: Doubles, labels: NDArray[np.int32], step: tuple[int, int]) -> tuple[Doubles, Doubles]:
    """Return the sums of products of errors, and the numbers of pairs on one surface, of each distance `APART`."""
    sums, counts = np.zeros(len(APART)), np.zeros(len(APART))
    rows, columns = labels.shape
    for place, distance in enumerate(APART):
        down, right = step[0] * distance, step[1] * distance
        if down >= rows or abs(right) >= columns:
            continue
        one = (slice(0, rows - down), slice(max(0, -right), columns - max(0, right)))
        two = (slice(down, rows), slice(max(0, right), columns + min(0, right)))
        same = (labels[one] == labels[two]) & (labels[one] > 0)
        sums[place], counts[place] = float(np.sum((error[one] * error[two])[same])), np.count_nonzero(same)
    return sums, counts


def _mean(sums: Doubles, counts: Doubles) -> float:
    """Return the mean over distances of mean products; those without a pair do not count."""
    known = counts > 0
    return float(np.mean(sums[known] / counts[known])) if known.any() else 0.0
