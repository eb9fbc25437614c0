"""Numbers of points along a Hilbert curve: neighbours in space have numbers that lie near each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]
Ints = NDArray[np.int32]

CURVE_BITS = 10
"""Bits of each coordinate."""
_ORDERS = (
    "01327645 07163425 01763245 61527043 43527061 45327601 07341625 03741265 "
    "47305621 03127465 47563021 67105423 43705261 45763201 61705243 65127403 "
    "21563047 67541023 23541067 25341607 25163407 65741203 21305647 23105467 "
)
"""For each of the 24 ways in which the curve goes through a cube, the numbers of its octants by x, y and z."""
_WAYS = (
    "bcdaefga hijklcbb gamnocbc pqddjkra sfeepqjk tfefdaun jkrahigg avnjghmh "
    "wrkxigim cpbjfhej qlkbiske rgxmlolb xnvwmmhi unocmntf vwhioolc dpupavnj "
    "qdquwrkx lbrdserg stserdxu ttsfvwpq uupqxnvw ovcptvfh woqlwtis xuloxmst "
)
"""The way in which it goes through each of those, a letter for each; through the whole it goes in that of letter a."""


def _two_levels() -> tuple[Ints, Ints]:
    """Return [ways 64] the numbers of octants of octants, by two bits of x, of y and of z, and the ways, times 64, in
    which the curve goes through them."""
    order = np.array([[int(digit) for digit in word] for word in _ORDERS.split()])
    way = np.array([[ord(letter) - ord("a") for letter in word] for word in _WAYS.split()])
    x, y, z = np.meshgrid(*[np.arange(4)] * 3, indexing="ij")
    outer, inner = (((x >> bit & 1) << 2 | (y >> bit & 1) << 1 | z >> bit & 1).ravel() for bit in (1, 0))
    numbers = order[:, outer] << 3 | order[way[:, outer], inner]
    return numbers.ravel().astype(np.int32), (64 * way[way[:, outer], inner]).ravel().astype(np.int32)


_NUMBERS, _NEXT = _two_levels()
_PAIRS = np.arange(0, CURVE_BITS, 2, dtype=np.int32)
_SPREAD: Ints = ((np.arange(1 << CURVE_BITS, dtype=np.int32)[:, None] >> _PAIRS & 3) << 3 * _PAIRS + 4).sum(
    axis=1, dtype=np.int32
)
"""Of a coordinate each two bits as the first two of six."""


def curve_numbers(points: Doubles, low: Doubles, high: Doubles) -> NDArray[np.int64]:
    """Return [n] the numbers of points [n, 3] along a Hilbert curve through a box's cube, below 2^30.

    The curve is that of Skilling 2004, "Programming the Hilbert curve".
    """
    side = max(float((high - low).max()), 1e-30)
    most = (1 << CURVE_BITS) - 1
    x, y, z = np.clip((points - low) / side * most, 0, most).astype(np.int32).T
    place = _SPREAD.take(x) | _SPREAD.take(y) >> 2 | _SPREAD.take(z) >> 4
    number, way = np.zeros(len(place), np.int32), np.zeros(len(place), np.int32)
    for pair in reversed(range(CURVE_BITS // 2)):
        key = way + (place >> 6 * pair & 63)
        number = number << 6 | _NUMBERS.take(key)
        way = _NEXT.take(key)
    return number.astype(np.int64)
