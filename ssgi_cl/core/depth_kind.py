"""Kind of a depth map, told by its planes: on them 1 / depth is linear in the image, if it is planar depth."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.depth_maps import ray_lengths

KINDS = ("planar", "ray", "inverse", "normalised", "remapped")
"""Kinds of depth in files: along the camera's axis, along the view ray, 1 / planar depth, OpenGL's 0..1 between
the camera's near and far plane, and 0..1 between two depths that are given."""

STEP = 1.0 / 12.0
"""Share of the image between the three pixels whose 1 / depth is held to a line: the angle between their rays
tells planar depth from distances by its square, some thousandths, six times the rounding of half floats."""
MOST_SAMPLES = 40_000
LEAST_VOTES = 100
"""Places on planes below which nothing is told."""
CLEAR = 0.25
"""How much closer to a line one kind has to be than the other for a place to count."""
WON = 0.75
"""Share of these places on which the better kind is closer, for the kind to be clear."""
FLAT = 6e-4
"""Deviation from a line above which a place is on no plane, but across an edge, or the camera is another: a half
float's rounding, 2.4e-4, of each of the three."""
TINY = 3e-7
"""Deviation from a line below which all is rounding."""


class Kind(NamedTuple):
    """What planes say of a depth map.

    Attributes:
        name: "planar", "ray" or "inverse".
        clear: whether planes tell; if not, the name is "planar".
        residual, other: median deviation of 1 / depth from a line on planes, relative, of this kind and of the
            nearest other one; NaN where not clear.
    """

    name: str
    clear: bool
    residual: float = float("nan")
    other: float = float("nan")


def detected_kind(values: NDArray[Any], camera: Camera, expected: str = "planar") -> Kind:
    """Return the kind of a depth map: planar, along the ray, or the inverse of planar depth.

    Args:
        values: [rows, columns] depths as a file has them; what is not finite or not above 0 is left out.
        camera: saw it, of the same size. Of an orthographic one planar depth and distances are the same.
        expected: "inverse" where planes that face the camera, on which planar depth and its inverse are flat, shall
            not be taken for planar depth.
    """
    if camera.is_orthographic or min(values.shape) < 8:
        return Kind("planar", clear=False)
    step = max(round(min(values.shape) * STEP), 2)
    # A grid of places alone: of a large image all of them would take longer than ambient occlusion.
    stride = max(1, math.ceil(math.sqrt(values.size / MOST_SAMPLES)))
    rows, columns = (np.arange(step, count - step, stride) for count in values.shape)
    lengths = ray_lengths(camera)
    inverses: dict[str, list[NDArray[np.float64]]] = {"planar": [], "ray": [], "inverse": []}
    for down, across in ((0, 0), (0, -step), (0, step), (-step, 0), (step, 0)):
        place = np.ix_(rows + down, columns + across)
        with np.errstate(divide="ignore", invalid="ignore"):
            stored = values[place].astype(np.float64)
            given = np.where(np.isfinite(stored) & (stored > 0.0), stored, np.nan)
            inverses["planar"].append(1.0 / given)
        inverses["ray"].append(lengths[place] / given)
        inverses["inverse"].append(given)
    bends = {name: _bends(*around) for name, around in inverses.items()}
    best, other, votes = _better(bends, "planar", "ray")
    rival, second, more = _better(bends, best, "inverse")
    if rival == "inverse" and more is not None:
        best, other, votes = rival, second, more
    if votes is None or ((best, expected) == ("planar", "inverse") and more is None):
        return Kind("planar", clear=False)
    return Kind(best, True, float(np.median(bends[best][votes])), float(np.median(bends[other][votes])))


def _bends(
    middle: NDArray[np.float64],
    left: NDArray[np.float64],
    right: NDArray[np.float64],
    above: NDArray[np.float64],
    below: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return how far places are from the middle of two others in their row and column, relative."""
    # Both ways: an edge bends one of them alone.
    bend = np.maximum(np.abs(left + right - 2.0 * middle), np.abs(above + below - 2.0 * middle))
    return (bend / (2.0 * np.abs(middle))).ravel()


def _better(bends: dict[str, NDArray[np.float64]], one: str, two: str) -> tuple[str, str, NDArray[np.bool_] | None]:
    """Return the better of two kinds, the other, and where planes say so; None if they do not."""
    first, second = np.maximum(bends[one], TINY), np.maximum(bends[two], TINY)
    for_one = first < np.minimum(CLEAR * second, FLAT)  # false for NaN
    for_two = second < np.minimum(CLEAR * first, FLAT)
    counts = np.count_nonzero(for_one), np.count_nonzero(for_two)
    better, other, votes = (one, two, for_one) if counts[0] >= counts[1] else (two, one, for_two)
    clear = max(counts) >= min(LEAST_VOTES, 0.02 * first.size) and max(counts) >= WON * sum(counts)
    return better, other, votes if clear else None


def planar_of(
    values: NDArray[np.float32],
    camera: Camera,
    kind: str | None,
    *,
    expected: str = "planar",
    depth_range: tuple[float, float] | None = None,
) -> tuple[NDArray[np.float32], str]:
    """Return linear view depth of what a file has, +inf where nothing is, and a note on its kind.

    Args:
        values: [rows, columns]; +inf where nothing is.
        camera: saw it, of the same size or without its margin.
        kind: one of `KINDS`, or None to find it by planes.
        expected: the kind where planes do not tell; "remapped", or "" for one that has to be said, where all are
            in 0..1.
        depth_range: depths of the values 0 and 1 of "remapped" depth, scene units.

    Raises:
        ValueError: an unknown kind; a kind that needs a range, or a camera with a far plane, without it.
    """
    if kind is not None:
        checks.choice("depth_kind", kind, KINDS)
    elif depth_range is None and expected in ("", "remapped"):
        if (np.nan_to_num(values, nan=0.0, posinf=0.0) <= 1.0).all():
            raise ValueError(
                "all depths are in 0..1, which this program also writes for remapped ones: expected depth_range=(depth "
                "of 0, depth of 1), or depth_kind='planar', 'ray' or 'normalised'"
            )
        expected = "planar"
    rows, columns = ((have - want) // 2 for have, want in zip(values.shape, camera.size, strict=True))
    camera = camera.with_margin((rows, columns)) if rows or columns else camera
    if depth_range is not None and kind not in (None, "remapped"):
        raise ValueError(f"depth_range is {depth_range}: expected None, as depth_kind is {kind!r}")
    if kind == "remapped" or depth_range is not None:
        return _remapped(values, depth_range)
    if kind == "normalised":
        return _normalised(values, camera)
    note = f"depth is {_WORDS[kind]}, as said" if kind else ""
    if kind is None:
        found = detected_kind(values, camera, expected)
        kind = found.name if found.clear else expected
        note = f"depth is taken for {_WORDS[kind]}: no planes tell"
        if found.clear:
            note = f"depth is {_WORDS[kind]}: planes are flat to {found.residual:.1g}, otherwise to {found.other:.1g}"
    with np.errstate(divide="ignore", invalid="ignore"):
        if kind == "inverse":
            values = np.where(values == 0.0, np.float32(np.inf), 1.0 / values).astype(np.float32)
        elif kind == "ray" and not camera.is_orthographic:
            values = (values / ray_lengths(camera)).astype(np.float32)
    return values, note


_WORDS = {"planar": "planar", "ray": "distance along the view ray", "inverse": "1 / planar depth"}


def _remapped(values: NDArray[np.float32], depth_range: tuple[float, float] | None) -> tuple[NDArray[np.float32], str]:
    if depth_range is None:
        raise ValueError(
            "depth_range is None: expected the depths of the values 0 and 1, in scene units, for remapped depth"
        )
    zero, one = (checks.number(f"depth_range[{i}]", depth_range[i], low=0.0, unit="scene units") for i in (0, 1))
    if zero == one:
        raise ValueError(f"depth_range is {depth_range}: expected two different depths")
    depth = zero + values.astype(np.float64) * (one - zero)
    # Clamped values say nothing of what lies behind.
    clamped = values >= 1.0 if one > zero else values <= 0.0
    note = f"depth runs from {zero:g} at 0 to {one:g} at 1; what is clamped to the farthest counts as nothing"
    return np.where(clamped, np.inf, depth).astype(np.float32), note


def _normalised(values: NDArray[np.float32], camera: Camera) -> tuple[NDArray[np.float32], str]:
    near, far = camera.near, camera.far
    if not np.isfinite(far) or near <= 0.0:
        raise ValueError(
            f"camera has near {near:g} and far {far:g}: expected 0 < near < far < inf for normalised depth"
        )
    given = values.astype(np.float64)
    depth = near + given * (far - near) if camera.is_orthographic else near * far / (far - given * (far - near))
    note = f"depth is normalised between {near:g} and {far:g}"
    return np.where(values >= 1.0, np.inf, depth).astype(np.float32), note
