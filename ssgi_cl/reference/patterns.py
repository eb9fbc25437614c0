"""Sampling patterns in float64, from the definitions of their sources.

Nothing here is shared with `ssgi_cl.techniques`; tests hold both to each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]

GOLDEN_RATIO = (1.0 + np.sqrt(5.0)) / 2.0
GOLDEN_ANGLE = 2.0 * np.pi * (1.0 - 1.0 / GOLDEN_RATIO)
"""Of Vogel's spiral (1979), radians: 137.5 degrees."""


def bayer(doublings: int = 2) -> NDArray[np.int_]:
    """Return the ordered-dither matrix of Bayer 1973 with sides of 2^doublings: numbers from 0 on, by default to 15.

    D_2n = [[4 D_n, 4 D_n + 2], [4 D_n + 3, 4 D_n + 1]] with D_1 = [[0]].
    """
    matrix = np.zeros((1, 1), int)
    for _ in range(doublings):
        matrix = np.block([[4 * matrix, 4 * matrix + 2], [4 * matrix + 3, 4 * matrix + 1]])
    return matrix


def radical_inverse(number: int) -> float:
    """Return the binary digits of a number mirrored at the point (van der Corput 1935)."""
    return sum(int(digit) / 2.0 ** (place + 1) for place, digit in enumerate(f"{number:b}"[::-1]))


@dataclass(frozen=True, eq=False)
class SlicePattern:
    """Slices and taps of the pixels of a 4 x 4 tile.

    Attributes:
        angle: [4, 4, slices] of each slice from +columns towards +rows, radians, in [0, pi).
        share: [4, 4, slices, taps] distance of each tap, in parts of the radius.
        dither: [4, 4, slices] of a sector's border, in [0, 1).
    """

    angle: Doubles
    share: Doubles
    dither: Doubles


def slice_pattern(params: Any) -> SlicePattern:
    """Return the pattern of a scan: Hammersley's 16 points in the order of `bayer`.

    Pixel k has its slices (k + 1/2) / 16 of the angle between two of them further on, and its taps
    Phi_2(k) + 1/32 of the distance between two, one slice after the other 1 / slices more. Dithers
    are the golden-ratio sequence over all slices of a tile. With frame n, all angles are n / g further on, taps
    n / g^2, dithers n over the golden ratio, where g^3 = g + 1 (Roberts 2018).

    Of a `checkerboard` the pixels of even row + column, which are the first 8, have 8 points in place of 16; the others
    the same again.

    Args:
        params: with `slices`, `taps` and `tap_power`; those that join taps (`joined`) have them
            half a tap farther away; `frame`, 0 by default, and `checkerboard`.
    """
    slices, taps, frame = params.slices, params.taps, getattr(params, "frame", 0)
    root = 1.0
    for _ in range(64):  # x <- (1 + x)^(1/3) converges to it
        root = (1.0 + root) ** (1.0 / 3.0)
    beyond = 0.5 if getattr(params, "joined", False) else 0.0
    angle, dither = np.zeros((2, 4, 4, slices))
    share = np.zeros((4, 4, slices, taps))
    points = 8 if getattr(params, "checkerboard", False) else 16
    for (row, column), k in np.ndenumerate(bayer()):
        own = int(k) % points
        for s in range(slices):
            angle[row, column, s] = np.pi / slices * (s + ((own + 0.5) / points + frame / root) % 1.0)
            shift = (radical_inverse(own) + 0.5 / points + s / slices + frame / root**2) % 1.0
            for t in range(taps):
                share[row, column, s, t] = ((t + shift + beyond) / taps) ** params.tap_power
            dither[row, column, s] = (0.5 + (k + 16 * s + frame) / GOLDEN_RATIO) % 1.0
    return SlicePattern(angle, share, dither)


def ball_points(count: int, length_power: float) -> Doubles:
    """Return [count, 3] points of the unit ball from the R3 sequence (Roberts 2018).

    u_n = 1/2 + n (1 / g, 1 / g^2, 1 / g^3) modulo 1 from n = 1 on, g > 0 the root of g^4 = g + 1:
    z uniform from 1 to -1, then the azimuth, then the length u^length_power.
    """
    root = 1.0
    for _ in range(64):  # x <- (1 + x)^(1/4) converges to it
        root = (1.0 + root) ** 0.25
    points = np.zeros((count, 3))
    for n in range(count):
        u, v, w = ((0.5 + (n + 1) / root**power) % 1.0 for power in (1, 2, 3))
        polar, azimuth = np.arccos(1.0 - 2.0 * u), 2.0 * np.pi * v
        points[n] = w**length_power * np.array(
            [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)]
        )
    return points


def reflected_points(count: int, length_power: float) -> Doubles:
    """Return [8, 8, count, 3]: the points that each pixel of a tile takes.

    Pixel k of `bayer` takes every 64th of one list from its k-th on, reflected at the plane across
    a unit vector of its own (Mittring 2007): the k-th of a spiral over the half sphere z > 0, at
    z = (k + 1/2) / 64 and k golden angles.
    """
    points = ball_points(64 * count, length_power)
    result = np.zeros((8, 8, count, 3))
    for (row, column), k in np.ndenumerate(bayer(3)):
        z, azimuth = (k + 0.5) / 64.0, k * GOLDEN_ANGLE
        ring = np.sqrt((1.0 - z) * (1.0 + z))
        vector = np.array([ring * np.cos(azimuth), ring * np.sin(azimuth), z])
        mirror = np.eye(3) - 2.0 * np.outer(vector, vector)  # Householder
        result[row, column] = points[k::64] @ mirror
    return result


def tile_disk() -> tuple[Doubles, Doubles]:
    """Return [4, 4, 2] points of the unit disk and [4, 4] shifts in (0, 1), for each pixel.

    Pixel k of `bayer` has the k-th of 16 points of Vogel's spiral, of equal area each, and
    Phi_2(k) + 1/32.
    """
    points, shift = np.zeros((4, 4, 2)), np.zeros((4, 4))
    for (row, column), k in np.ndenumerate(bayer()):
        distance, angle = np.sqrt((k + 0.5) / 16.0), k * GOLDEN_ANGLE
        points[row, column] = distance * np.cos(angle), distance * np.sin(angle)
        shift[row, column] = radical_inverse(int(k)) + 1.0 / 32.0
    return points, shift


def square_points(count: int) -> Doubles:
    """Return [count, 2] of Hammersley's points of the unit square, moved by half a step each."""
    return np.array([((n + 0.5) / count, (radical_inverse(n) + 0.5 / count) % 1.0) for n in range(count)])


def disk_pattern(count: int, weights: str) -> Doubles:
    """Return [count, 4] places x, y in the unit disk, 0, and the area that each stands for.

    Dachsbacher and Stamminger 2005, section 4.1: (xi_1 sin 2 pi xi_2, xi_1 cos 2 pi xi_2), xi_1
    uniform; weights proportional to xi_1^2 ("paper"), or to xi_1, one over the density
    ("unbiased"). They add up to pi. xi_2 is the golden-ratio sequence.
    """
    pattern = np.zeros((count, 4))
    for n in range(count):
        xi, turn = (n + 0.5) / count, 2.0 * np.pi * n / GOLDEN_RATIO
        weight = xi if weights == "unbiased" else xi**2
        pattern[n] = xi * np.cos(turn), xi * np.sin(turn), 0.0, weight
    pattern[:, 3] *= np.pi / pattern[:, 3].sum()
    return pattern


def cap_pattern(count: int, weights: str, reach: float) -> Doubles:
    """Return [count, 4] directions within `reach` radians of +z and their solid angles, sr.

    `disk_pattern` with angles to +z for distances; the density per solid angle is one over the sine
    of the angle. Weights add up to the cap's solid angle, 2 pi (1 - cos reach).
    """
    pattern = np.zeros((count, 4))
    for n in range(count):
        xi, turn = (n + 0.5) / count, 2.0 * np.pi * n / GOLDEN_RATIO
        polar = reach * xi
        pattern[n] = (
            np.sin(polar) * np.cos(turn),
            np.sin(polar) * np.sin(turn),
            np.cos(polar),
            np.sin(polar) if weights == "unbiased" else xi**2,
        )
    pattern[:, 3] *= 4.0 * np.pi * np.sin(0.5 * reach) ** 2 / pattern[:, 3].sum()
    return pattern


def tile_turns() -> Doubles:
    """Return [4, 4] radians by which the pixels of a tile turn a pattern: 16 even steps."""
    turns: Doubles = bayer().astype(np.float64) * (2.0 * np.pi / 16.0)
    return turns
