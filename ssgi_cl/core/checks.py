"""Validation of arguments: messages name the argument, its value, what is allowed and the unit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.array_kinds import host_array
from ssgi_cl.core.errors import shown


class Limits(TypedDict, total=False):
    """Range of numbers: [low, high], or (low, high] with `above`; with `infinite` +inf too."""

    low: float
    high: float
    unit: str
    above: bool
    infinite: bool


def number(
    name: str,
    value: object,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    unit: str = "",
    above: bool = False,
    infinite: bool = False,
) -> float:
    """Return `value` as a float within [low, high] ((low, high] with `above`), else raise."""
    allowed = _range(low, high, unit, above)
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise TypeError(f"{name} is {shown(value)}: expected a number {allowed}")
    try:
        result = float(value)
    except OverflowError:  # an integer of more than 308 digits
        result = math.inf if value > 0 else -math.inf
    inside = low < result <= high if above else low <= result <= high
    if math.isnan(result) or not inside or (math.isinf(result) and not infinite):
        raise ValueError(f"{name} is {shown(value)}: expected a number {allowed}")
    return result


def integer(name: str, value: object, *, low: int, high: int, unit: str = "") -> int:
    """Return `value` as an int within [low, high], else raise."""
    allowed = _range(low, high, unit, False)
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise TypeError(f"{name} is {shown(value)}: expected an integer {allowed}")
    if not low <= int(value) <= high:
        raise ValueError(f"{name} is {shown(int(value))}: expected an integer {allowed}")
    return int(value)


def switch(name: str, value: object) -> None:
    """Raise TypeError unless `value` is True or False."""
    if not isinstance(value, bool):
        raise TypeError(f"{name} is {shown(value)}: expected True or False")


def choice(name: str, value: object, allowed: Sequence[str]) -> str:
    """Return `value` if it is one of `allowed`, else raise."""
    if value not in allowed:
        options = ", ".join(repr(option) for option in allowed)
        near = get_close_matches(str(value), allowed, 1)
        guess = f"; did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"{name} is {shown(value)}: expected one of {options}{guess}")
    return str(value)


def vector(name: str, value: ArrayLike, size: int, unit: str = "") -> NDArray[np.float64]:
    """Return `value` as `size` finite float64 numbers; a scalar is repeated. Else raise."""
    value = unmasked(name, value)
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TypeError(f"{name} is {shown(value)}: expected {size} numbers{_of(unit)}") from error
    if array.ndim == 0:
        array = np.repeat(array, size)
    if array.shape != (size,):
        raise ValueError(f"{name} has shape {array.shape}: expected {size} numbers{_of(unit)}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} is {array.tolist()}: expected {size} finite numbers{_of(unit)}")
    return array


MOST_OFFSET = 1e30
"""Scene units from the world's origin, along each axis, of what has a place."""


LEAST_DEPTH, MOST_DEPTH = 1e-30, 1e30
"""Scene units: nearer and farther surfaces count as these, whose reciprocals and positions float32
holds at any angle."""


def point(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return `value` as a position within `MOST_OFFSET` of the world's origin, else raise."""
    array = vector(name, value, 3, "scene units")
    if (np.abs(array) > MOST_OFFSET).any():
        raise ValueError(f"{name} is {array.tolist()}: expected numbers of at most {limit(MOST_OFFSET)} (scene units)")
    return array


def direction(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return `value` as a float64 vector of unit length, else raise."""
    array = vector(name, value, 3)
    largest = float(np.abs(array).max())
    if largest == 0.0:
        raise ValueError(f"{name} is {array.tolist()}: expected a direction of non-zero length")
    scaled = array / largest
    return scaled / float(np.linalg.norm(scaled))


MOST_LIGHT = 1e30
"""W and what is counted by it: float32 holds its products with areas and solid angles."""


def rgb(name: str, value: ArrayLike, unit: str, *, high: float = MOST_LIGHT) -> NDArray[np.float64]:
    """Return `value` as three numbers within [0, high] (a scalar is repeated), else raise."""
    array = vector(name, value, 3, unit)
    if (array < 0).any() or (array > high).any():
        allowed = _range(0.0, high, unit, False)
        raise ValueError(f"{name} is {array.tolist()}: expected numbers {allowed}")
    return array


def matrix4(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return `value` as a finite float64 4x4 matrix, else raise."""
    array = floats(name, value, np.float64)
    if array.shape != (4, 4):
        raise ValueError(f"{name} has shape {array.shape}: expected (4, 4)")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} holds a value that is not finite: {array.tolist()}")
    return array


def plane(name: str, value: ArrayLike, *, channels: int = 0, **limits: Unpack[Limits]) -> NDArray[np.float32]:
    """Return `value` as float32 [rows, columns] or, with `channels`, [rows, columns, channels].

    Raises TypeError for a dtype that is not a real number, ValueError for a wrong shape, for NaN,
    for infinities (unless `infinite` allows +inf) and for values outside of the limits.
    """
    array = floats(name, value, np.float32)
    wanted = f"(rows, columns, {channels})" if channels else "(rows, columns)"
    fits = array.ndim == 3 and array.shape[2] == channels if channels else array.ndim == 2
    if not fits:
        raise ValueError(f"{name} has shape {array.shape}: expected {wanted}")
    values_in_range(name, array, **limits)
    return array


def plane_list(name: str, value: ArrayLike, width: int) -> NDArray[np.float32]:
    """Return `value` as finite float32 [count, width], else raise."""
    array = floats(name, value, np.float32)
    if array.ndim != 2 or array.shape[1] != width:
        raise ValueError(f"{name} has shape {array.shape}: expected (count, {width})")
    values_in_range(name, array)
    return array


def values_in_range(
    name: str,
    array: NDArray[np.float32],
    *,
    unit: str = "",
    low: float = -math.inf,
    high: float = math.inf,
    infinite: bool = False,
    above: bool = False,
) -> None:
    """Raise ValueError naming the first element that is NaN, infinite or outside of the limits."""
    if array.size == 0 or (infinite and np.isposinf(array).all()):
        return
    # min and max are NaN if any element is: two passes without a temporary decide the good case.
    # Of the array's type, in which limits are compared: the float32 next to 1e30 is greater than that.
    least, most = array.min(), array.max()
    fine = (least > low if above else least >= low) and most <= high
    if fine and math.isfinite(least) and (infinite or math.isfinite(most)):
        return
    outside = (array <= low) if above else (array < low)
    wrong = np.isnan(array) | outside | (array > high) | np.isneginf(array)
    if not infinite:
        wrong |= np.isposinf(array)
    where = tuple(int(i) for i in np.argwhere(wrong)[0])
    place = ", ".join(map(str, where))
    allowed = _range(low, high, unit, above) + (", or +inf" if infinite else "")
    raise ValueError(f"{name}[{place}] is {array[where]}: expected numbers {allowed}")


def as_array(name: str, value: ArrayLike) -> NDArray[Any]:
    """Return `value` as an array; raise ValueError for a masked array, as `unmasked`."""
    try:
        return host_array(unmasked(name, value))
    except TypeError as error:
        raise TypeError(f"{name}: {error}") from None


def unmasked(name: str, value: ArrayLike) -> ArrayLike:
    """Return `value`; raise ValueError if it is a masked array with elements that are masked."""
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        count = int(np.sum(np.ma.getmaskarray(value)))
        raise ValueError(
            f"{name} is a masked array with {count} masked elements: expected an array without a "
            "mask; fill it first, such as depth.filled(numpy.inf) where nothing is"
        )
    return value


def floats(name: str, value: ArrayLike, dtype: type[np.floating[Any]] = np.float32) -> NDArray[Any]:
    """Return `value` in C order as `dtype`; raise TypeError unless it holds real numbers."""
    given = as_array(name, value)
    if given.dtype.kind not in "fiu":
        raise TypeError(f"{name} has dtype {given.dtype}: expected a real floating-point array")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(given, dtype=dtype)


def limit(value: float) -> str:
    """Return a limit as text: whole numbers to the last digit."""
    return f"{value:.0f}" if abs(value) < 1e9 and value == round(value) else f"{value:g}"


def _range(low: float, high: float, unit: str, above: bool) -> str:
    left = f"{'>' if above else '>='} {limit(low)}" if low > -math.inf else ""
    right = f"<= {limit(high)}" if high < math.inf else ""
    both = " and ".join(part for part in (left, right) if part) or "that is finite"
    return f"{both}{_of(unit)}"


def _of(unit: str) -> str:
    return f" ({unit})" if unit else ""
