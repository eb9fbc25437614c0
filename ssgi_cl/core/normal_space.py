"""Space of a normal map, told by holding it to the normals of the depth beside it.

A candidate is an encoding (signed, or 0..1 as in pictures) and axes. Of two, that is better whose
normals are closer to those of the depth on most of the pixels on which they differ; sides of a
surface, of which a mesh may say either, count only between candidates that are alike without them.
World axes that nothing is known of are found too: the rotation that brings the normals closest to
those of the depth (Wahba 1965, SIAM Review 7 (3); solved by the singular value decomposition,
Markley 1988).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera

Matrix = NDArray[np.float64]

AXES: dict[str, Matrix] = {
    "camera": np.diag([1.0, 1.0, 1.0]),
    "opencv": np.diag([1.0, -1.0, -1.0]),
    "camera, y down": np.diag([1.0, -1.0, 1.0]),
    "camera, z forward": np.diag([1.0, 1.0, -1.0]),
}
"""Spaces of the camera by name, and what takes their normals to view space: +x right, +y up, towards the viewer +z.
"opencv" has +y down and +z forward."""

SAME = np.eye(3)
"""Of worlds with the same axes."""

SPACES = (*AXES, "world")
"""Spaces that a normal map may be said to have."""

ENCODED = ", 0..1"
"""Ends the name of a space whose normals are stored as (n + 1) / 2."""

MOST_SAMPLES = 20_000
LEAST_SAMPLES = 50
REACH = 100.0
"""Share of the image between the pixels that a normal is made of: noise of the depth counts less than in neighbours."""
CLEAR = 35.0
"""Degrees: a mean angle above it says nothing; normals of no relation have 57."""
DIFFERENT = math.radians(3.0)
"""Angles that differ by less are taken for equal."""
FEW = 0.02
"""Share of the pixels below which a difference between two candidates does not count."""
WON = 0.7
"""Share of the pixels with a difference on which the better candidate is closer, for the space to be clear."""
TURNED = math.radians(8.0)
"""Least angle between axes that are found and those of the camera: less is an error of the depth or its camera."""
UNIT = 0.02
"""How far from 1 lengths of normals may be that tell their encoding; a tenth of the pixels may be farther."""
SPREAD = 0.1
"""Least strength of the second direction of normals, as a share of the first's, to find axes by."""
SMOOTH = 0.25
"""How much a surface may bend between the pixels that a normal is made of, as a share of their distance."""


class Space(NamedTuple):
    """A candidate for the space of a normal map.

    Attributes:
        name: as in `SPACES`, with `ENCODED` where the values are in 0..1.
        to_view: [3, 3] float64, from its axes to view space; a rotation, or one with a mirror.
        residual: mean angle to the normals of the depth in degrees, the largest tenth left out; NaN if
            it was not measured.
        found: whether its axes were fitted.
    """

    name: str
    to_view: Matrix
    residual: float = float("nan")
    found: bool = False

    @property
    def encoded(self) -> bool:
        """Whether its values are in 0..1."""
        return self.name.endswith(ENCODED)

    def decoded(self, normal: NDArray[Any]) -> NDArray[Any]:
        """Return signed normals [..., 3] of stored ones; 0 stays 0."""
        if not self.encoded:
            return normal
        return np.where((normal != 0.0).any(axis=-1, keepdims=True), 2.0 * normal - 1.0, 0.0)


class UnclearSpaceError(ValueError):
    """The space of a normal map is not clear; the message has the two best candidates.

    Attributes:
        few: whether there are too few pixels on smooth surfaces to tell.
    """

    def __init__(self, message: str, *, few: bool = False) -> None:
        super().__init__(message)
        self.few = few


def named_space(name: str, camera: Camera, axes: Matrix = SAME) -> Space:
    """Return the space that is called `name`; for `axes` see `detected_space`. ValueError: there is none."""
    plain = name.removesuffix(ENCODED)
    if plain not in SPACES:
        listed = ", ".join(map(repr, SPACES))
        raise ValueError(
            f"normal_space is {name!r}: expected one of {listed}, each with {ENCODED!r} or without, or None"
        )
    return Space(name, camera.view[:3, :3] @ axes if plain == "world" else AXES[plain])


def detected_space(
    normal: NDArray[Any], depth: NDArray[Any], camera: Camera, *, world: bool, axes: Matrix = SAME
) -> Space:
    """Return the space of a normal map.

    Args:
        normal: [rows, columns, 3], of any length; 0 where there is none.
        depth: [rows, columns] linear view depth; +inf where nothing is.
        camera: saw both.
        world: whether the camera's rotation is known. If not, world axes are fitted.
        axes: [3, 3], from the axes of the normals' world to those of the camera's.

    Raises:
        UnclearSpaceError: no candidate fits, or two that mean different things fit alike.
    """
    rows, columns, expected = sampled_normals(depth, camera)
    stored = np.asarray(normal[rows, columns], np.float64)
    there = np.isfinite(stored).all(axis=-1) & (stored != 0.0).any(axis=-1)
    stored, expected = stored[there], expected[there]
    if len(stored) < LEAST_SAMPLES:
        raise UnclearSpaceError(
            f"normal has {len(stored)} pixels on smooth surfaces: expected {LEAST_SAMPLES} to tell its space; "
            f"say it by normal_space, one of {', '.join(map(repr, SPACES))}",
            few=True,
        )
    candidates = [
        _Judged(space, stored, expected) for space in _candidates(stored, camera.view[:3, :3] @ axes if world else None)
    ]
    best = _best(candidates)
    if not world and _spans(expected):
        fitted = min((_fitted(each, stored, expected) for each in _plain(candidates)), key=lambda each: each.residual)
        turned = _angle(fitted.space.to_view, best.space.to_view) >= TURNED
        if turned and fitted.residual <= CLEAR and _won(fitted, best) >= WON:
            return fitted.measured()
    rivals = [each for each in candidates if each is not best and _won(best, each) < WON]
    if best.residual <= CLEAR and not rivals:
        return best.measured()
    second = min(rivals or [each for each in candidates if each is not best], key=lambda each: each.residual)
    raise UnclearSpaceError(
        f"normal is in no space that is clear: {best.space.name!r} is {best.residual:.1f} degrees and "
        f"{second.space.name!r} is {second.residual:.1f} degrees off the normals of the depth (mean); expected at most "
        f"{CLEAR:g}, and the first closer on {WON:.0%} of the pixels on which they differ. Say it by normal_space, or "
        "leave the normals out: they are then made from the depth"
    )


def sampled_normals(
    depth: NDArray[Any], camera: Camera
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Return (row, column, normal [n, 3] in view space) of pixels where the depth is smooth."""
    height, width = depth.shape
    step = max(1, round((height * width / MOST_SAMPLES) ** 0.5))
    reach = max(1, round(min(height, width) / REACH))
    rows, columns = (
        index.ravel()
        for index in np.meshgrid(*(np.arange(reach, n - reach, step) for n in (height, width)), indexing="ij")
    )
    sx, sy, ox, oy = camera.pixel_to_view
    margin = (height - camera.height) / 2, (width - camera.width) / 2

    def position(row: NDArray[np.intp], column: NDArray[np.intp]) -> NDArray[np.float64]:
        deep = depth[row, column].astype(np.float64)
        k = 1.0 if camera.is_orthographic else deep
        across, down = column + 0.5 - margin[1], row + 0.5 - margin[0]
        return np.stack([(sx * across + ox) * k, (sy * down + oy) * k, -deep], axis=-1)

    with np.errstate(invalid="ignore"):
        centre = position(rows, columns)
        left, right = position(rows, columns - reach), position(rows, columns + reach)
        above, below = position(rows - reach, columns), position(rows + reach, columns)
        smooth = np.isfinite(centre).all(axis=-1)
        for one, other in ((left, right), (above, below)):
            bend = np.linalg.norm(one + other - 2.0 * centre, axis=-1)
            smooth &= bend <= SMOOTH * np.linalg.norm(one - other, axis=-1)  # False where one is infinite
        normal = np.cross(right - left, above - below)
        length = np.linalg.norm(normal, axis=-1)
        smooth &= length > 0.0
    return rows[smooth], columns[smooth], normal[smooth] / length[smooth, None]


def _candidates(stored: NDArray[np.float64], world: Matrix | None) -> list[Space]:
    spaces = [Space(name, axes) for name, axes in AXES.items()]
    if world is not None:
        spaces.append(Space("world", world))
    encoded = [space._replace(name=space.name + ENCODED) for space in spaces]
    if stored.min() < 0.0 or stored.max() > 1.0:
        return spaces
    off = [np.quantile(np.abs(np.linalg.norm(each, axis=-1) - 1.0), 0.9) for each in (stored, 2.0 * stored - 1.0)]
    if min(off) > UNIT:
        return spaces + encoded
    return spaces if off[0] < off[1] else encoded


def _spans(normal: NDArray[np.float64]) -> bool:
    """Return whether normals have more than one direction: else axes cannot be found from them."""
    strength = np.linalg.svd(normal, compute_uv=False)
    return bool(strength[1] >= SPREAD * strength[0])


def _plain(candidates: list[_Judged]) -> list[_Judged]:
    """Return a candidate for each encoding."""
    return [each for each in candidates if each.space.to_view is AXES["camera"]]


class _Judged:
    """A candidate with its angles to the normals of the depth, pixel by pixel."""

    def __init__(self, space: Space, stored: NDArray[np.float64], expected: NDArray[np.float64]) -> None:
        self.space = space
        cosine = np.einsum("ij,ij->i", _unit(space.decoded(stored)) @ space.to_view.T, expected).clip(-1.0, 1.0)
        self.angles = np.arccos(np.abs(cosine))
        self.sided = np.arccos(cosine)
        kept = np.sort(self.angles)[: max(1, math.ceil(0.9 * len(cosine)))]
        self.residual = float(np.degrees(kept.mean()))

    def wins(self, other: _Judged) -> float | None:
        """Return the share of the pixels with a difference on which this is closer; None if there are few."""
        for own, theirs in ((self.angles, other.angles), (self.sided, other.sided)):
            differ = np.abs(own - theirs) > DIFFERENT
            if np.mean(differ) >= FEW:
                return float(np.mean(own[differ] < theirs[differ]))
        return None

    def measured(self) -> Space:
        """Return the space with its residual."""
        return self.space._replace(residual=self.residual)


def _best(candidates: list[_Judged]) -> _Judged:
    """Return the candidate that wins against most; the first of those that are alike."""
    return max(candidates, key=lambda one: sum(_won(one, other) >= 0.5 for other in candidates if other is not one))


def _won(one: _Judged, other: _Judged) -> float:
    """Return the share of the pixels with a difference on which `one` is closer; 1 if there are few."""
    share = one.wins(other)
    return 1.0 if share is None else share


def _angle(one: Matrix, other: Matrix) -> float:
    """Return the angle between two axes in radians; opposite sides of a surface are the same."""
    return math.acos(min(1.0, (abs(float(np.trace(one @ other.T))) - 1.0) / 2.0))


def _unit(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    return normal / np.where(length > 0.0, length, 1.0)


def _fitted(plain: _Judged, stored: NDArray[np.float64], expected: NDArray[np.float64]) -> _Judged:
    """Return "world" with the axes that bring the normals closest to those of the depth, which may mirror.

    Normals that face away are turned round between two fits; the worse half has no part in the next.
    """
    normal, found = _unit(plain.space.decoded(stored)), []
    name = f"world{ENCODED}" if plain.space.encoded else "world"
    for mirror in (1.0, -1.0):
        facing, weight = normal, np.ones(len(normal))
        for _ in range(8):
            u, _, v = np.linalg.svd((expected * weight[:, None]).T @ facing)
            axes = u @ np.diag([1.0, 1.0, mirror * np.linalg.det(u @ v)]) @ v
            cosine = np.einsum("ij,ij->i", facing @ axes.T, expected)
            facing = np.where(cosine[:, None] < 0.0, -facing, facing)
            weight = (np.abs(cosine) >= np.median(np.abs(cosine))).astype(float)
        found.append(_Judged(Space(name, axes, found=True), stored, expected))
    return min(found, key=lambda each: float(each.sided.mean()))
