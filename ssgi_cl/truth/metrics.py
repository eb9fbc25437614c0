"""Metrics of the error of an image against its truth, over the pixels that count.

Images are [rows, columns] or [rows, columns, 3] in linear light. Of the mask [rows, columns] only
pixels that are True count; without one, all do. The truth comes second.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.vpls import LUMINANCE

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
Mask = NDArray[np.bool_]

PIXELS_PER_DEGREE = 67.02
"""Of FLIP: a display 0.7 m wide with 3840 columns, seen from 0.7 m."""

REGIONS = ("border", "thin", "silhouettes", "creases", "elsewhere")
"""Regions of an image, in the order in which they claim a pixel."""

STEP = 0.02
"""A silhouette: each of two neighbours is off the other's tangent plane by this share of depth (orthographic: of the
view's height)."""
CREASE_ANGLE = math.radians(25.0)
"""A crease: normals of neighbours on one surface turn by more than this, radians."""
REACH = 3
"""Pixels round a silhouette or crease that belong to it: error reaches that far, at least."""
BORDER = 0.05
"""Share of the shorter side of the image that its border takes on every side."""
THIN = 5
"""Columns or rows that a thin part covers, at most."""
MATERIAL_STEP = 0.25
"""An edge of materials: a reflectance, exponent or emission of neighbours differs by more than this share of the
larger one."""

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
    for region, own in _connected(where):
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
    for number, (region, own) in enumerate(_connected(where), start=1):
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


def smooth_surfaces(gbuffer: GBuffer) -> Mask:
    """Return where blotches can be told from edges, [rows, columns].

    Those are surfaces without a silhouette, a crease (see `regions`) or an edge of materials within
    3 pixels, of at least 400 pixels that share sides. A material's edge: albedo, specular, gloss or
    emission of two neighbours differ by more than 25 % of the larger one.

    Args:
        gbuffer: its first layer; normals that it lacks are taken from its depth.
    """
    depth = inner_array(gbuffer, "depth").astype(np.float64)
    away, _, _, turned = _edges(gbuffer, depth, *_normals(gbuffer, depth))
    found = np.isfinite(depth) & ~_grown(away | turned | _material_edges(gbuffer), REACH)
    for region, own in _connected(found):
        if own.sum() < WIDE**2:
            found[region] &= ~own
    return found


def regions(gbuffer: GBuffer) -> dict[str, Mask]:
    """Return where errors of screen-space methods tend to sit, each a mask [rows, columns].

    Every pixel that shows a surface is in exactly one of `REGIONS`; one that would fit several is
    in the first:

    - border: within 5 % of the image's shorter side from its edge, at least 1 pixel;
    - thin: what a row or column of the image crosses in at most 5 pixels between a silhouette on
      which it is the nearer side and another one;
    - silhouettes: within 3 pixels of two neighbours of which each lies off the other's tangent
      plane by more than 2 % of the smaller depth, or one shows nothing;
    - creases: within 3 pixels of two other neighbours whose normals, turned to the viewer, differ
      by more than 25 degrees;
    - elsewhere.

    Args:
        gbuffer: its first layer; normals that it lacks are taken from its depth.
    """
    depth = inner_array(gbuffer, "depth").astype(np.float64)
    seen = np.isfinite(depth)
    normal, known = _normals(gbuffer, depth)
    away, nearer, farther, turned = _edges(gbuffer, depth, normal, known)
    rows, columns = depth.shape
    margin = max(1, math.ceil(BORDER * min(rows, columns)))
    border = np.ones_like(seen)
    border[margin : rows - margin, margin : columns - margin] = False
    thin = np.zeros_like(seen)
    for axis in (0, 1):
        thin |= _between(farther[axis], nearer[axis], axis)
    claims = {
        "border": border,
        "thin": thin,
        "silhouettes": _grown(away, REACH),
        "creases": _grown(turned, REACH),
        "elsewhere": np.ones_like(seen),
    }
    free = seen.copy()
    result = {}
    for name, claim in claims.items():
        result[name] = claim & free
        free &= ~claim
    return result


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


def inner_array(gbuffer: GBuffer, name: str) -> NDArray[np.float32]:
    """Return an array of the first layer without the margin; ValueError if there is none."""
    array = gbuffer.first(name)
    if array is None:
        raise ValueError(f"gbuffer has no {name}")
    return gbuffer.inner(array)


def _normals(gbuffer: GBuffer, depth: Doubles) -> tuple[Doubles, Mask]:
    """Return normals [rows, columns, 3] that face the viewer, and where they are known.

    Without any, the cross product of the differences of position to the neighbour that is nearer
    in depth, on both axes.
    """
    # View rays and positions in view space, whose origin is near.
    position = _positions(gbuffer, depth)
    if gbuffer.normal is not None:
        world = inner_array(gbuffer, "normal").astype(np.float64)
        normal = world @ gbuffer.camera.view[:3, :3].T
    else:
        normal = np.cross(_slope(position, 0), _slope(position, 1))
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    known = np.isfinite(depth) & (length[..., 0] > 0.0) & np.isfinite(length[..., 0])
    normal = np.where(known[..., None], normal / np.where(known[..., None], length, 1.0), 0.0)
    view_ray = np.array([0.0, 0.0, -1.0]) if gbuffer.camera.is_orthographic else position
    n_dot_v = np.sum(np.where(known[..., None], normal * view_ray, 0.0), axis=-1)
    return np.where(n_dot_v[..., None] > 0.0, -normal, normal), known


def _positions(gbuffer: GBuffer, depth: Doubles) -> Doubles:
    """Return positions [rows, columns, 3] in view space; 0 where nothing is."""
    camera = gbuffer.camera
    sx, sy, ox, oy = camera.pixel_to_view
    deep = np.where(np.isfinite(depth), depth, 0.0)
    k = np.ones_like(deep) if camera.is_orthographic else deep
    x = (sx * (np.arange(camera.width) + 0.5) + ox) * k
    y = (sy * (np.arange(camera.height) + 0.5) + oy)[:, None] * k
    position: Doubles = np.stack([x, y, -deep], axis=-1)
    position[~np.isfinite(depth)] = 0.0
    return position


def _slope(position: Doubles, axis: int) -> Doubles:
    """Return the difference to the neighbour before or after, whichever is closer in depth."""
    size = position.shape[axis]
    if size < 2:
        return np.zeros_like(position)
    step = np.diff(position, axis=axis)
    nothing = position[..., 2] == 0.0
    ends = [np.take(nothing, np.arange(i, size - 1 + i), axis=axis) for i in (0, 1)]
    step[ends[0] | ends[1]] = np.inf
    rim = np.full_like(np.take(step, [0], axis=axis), np.inf)
    before = np.concatenate([rim, step], axis=axis)
    after = np.concatenate([step, rim], axis=axis)
    closer = np.abs(before[..., 2:]) < np.abs(after[..., 2:])
    chosen = np.where(closer, before, after)
    return np.where(np.isfinite(chosen), chosen, 0.0)


def _edges(gbuffer: GBuffer, depth: Doubles, normal: Doubles, known: Mask) -> tuple[Mask, list[Mask], list[Mask], Mask]:
    """Compare neighbours.

    Returns:
        Where a pixel is next to a silhouette; for each axis whether the step to the next pixel
        leads to something farther, [size - 1 along the axis], or nearer, as (nearer, farther)
        lists; where a pixel is next to a crease.
    """
    position = _positions(gbuffer, depth)
    seen = np.isfinite(depth)
    away, turned = np.zeros_like(seen), np.zeros_like(seen)
    nearer, farther = [], []
    for axis in (0, 1):
        size = depth.shape[axis]
        one = tuple(slice(0, size - 1) if a == axis else slice(None) for a in (0, 1))
        two = tuple(slice(1, size) if a == axis else slice(None) for a in (0, 1))
        step = position[two] - position[one]
        least = np.minimum(depth[one], depth[two])
        off = np.minimum(
            *(np.where(known[side], np.abs(np.sum(step * normal[side], axis=-1)), np.inf) for side in (one, two))
        )
        both = seen[one] & seen[two]
        # Off both tangent planes: a crease lies off one of them by less than the step in depth.
        apart = both & (off > STEP * gbuffer.camera.tolerance_depth(np.where(both, least, 1.0)))
        edge = apart | (seen[one] != seen[two])
        with np.errstate(invalid="ignore"):
            farther.append(edge & (depth[two] > depth[one]))
            nearer.append(edge & (depth[two] < depth[one]))
        bend = np.sum(normal[one] * normal[two], axis=-1) < math.cos(CREASE_ANGLE)
        bend &= both & ~edge & known[one] & known[two]
        for mask, found in ((away, edge), (turned, bend)):
            mask[one] |= found
            mask[two] |= found
    return away, nearer, farther, turned


def _between(farther: Mask, nearer: Mask, axis: int) -> Mask:
    """Return the pixels between a step nearer and, within `THIN` pixels, a step farther."""
    shape = list(farther.shape)
    shape[axis] += 1
    entered, left = np.moveaxis(nearer, axis, 0), np.moveaxis(farther, axis, 0)
    found = np.moveaxis(np.zeros(shape, np.bool_), axis, 0)
    size = len(found)
    for width in range(1, THIN + 1):
        # Pixels i + 1 to i + width: step i enters, step i + width leaves.
        count = size - 1 - width
        if count <= 0:
            break
        here = entered[:count] & left[width : width + count]
        for k in range(width):
            found[1 + k : 1 + k + count] |= here
    return np.moveaxis(found, 0, axis)


def _material_edges(gbuffer: GBuffer) -> Mask:
    """Return where a pixel is next to one of another material."""
    found = np.zeros(gbuffer.size, np.bool_)
    for name in ("albedo", "specular", "gloss", "emission"):
        if getattr(gbuffer, name) is None:
            continue
        values = np.nan_to_num(inner_array(gbuffer, name).astype(np.float64))
        values = values.reshape(*values.shape[:2], -1)
        for axis in (0, 1):
            one, two = (np.moveaxis(values, axis, 0)[part] for part in (slice(None, -1), slice(1, None)))
            apart = np.any(np.abs(one - two) > MATERIAL_STEP * np.maximum(np.abs(one), np.abs(two)), axis=-1)
            along = np.moveaxis(found, axis, 0)
            along[:-1] |= apart
            along[1:] |= apart
    return found


def _connected(mask: Mask) -> Iterator[tuple[tuple[slice, slice], Mask]]:
    """Give the box round each set of pixels that share sides, and where it is in its box."""
    from scipy import ndimage  # takes a fifth of a second, which other commands do without

    labels, _ = ndimage.label(mask)
    for number, region in enumerate(ndimage.find_objects(labels), start=1):
        yield region, labels[region] == number


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


def _grown(mask: Mask, reach: int) -> Mask:
    """Return the mask with all pixels within `reach` rows and columns of it."""
    from scipy.ndimage import binary_dilation  # takes a fifth of a second, which other commands do without

    side = 2 * reach + 1
    grown: Mask = binary_dilation(mask, np.ones((side, side), np.bool_))
    return grown
