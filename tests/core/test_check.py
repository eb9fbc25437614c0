"""Validation: what is refused, and that messages tell name, value, range and unit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core import checks


def test_numbers_of_any_real_type_are_taken() -> None:
    for value in (1, 1.0, np.float16(1), np.float32(1), np.int8(1), np.uint64(1)):
        result = checks.number("x", value, low=0, high=2)
        assert result == 1.0
        assert type(result) is float


@pytest.mark.parametrize("value", [True, "1", None, 1j, [1.0], np.array([1.0])])
def test_what_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(TypeError, match=r"x is .*: expected a number"):
        checks.number("x", value)


@pytest.mark.parametrize(
    ("value", "bounds", "message"),
    [
        *((value, {"low": 0, "high": 1, "unit": "m"}, r">= 0 and <= 1 \(m\)")
          for value in (-0.1, 1.1, math.nan, math.inf, -math.inf)),
        (0, {"low": 0, "above": True}, "> 0"),
        (math.inf, {}, "that is finite"),
    ],
)  # fmt: skip
def test_numbers_out_of_range_are_refused(value: float, bounds: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"x is .*: expected a number {message}"):
        checks.number("x", value, **bounds)


def test_the_lower_end_and_infinity_are_taken_where_they_are_allowed() -> None:
    assert checks.number("x", 0, low=0) == 0.0
    assert checks.number("x", math.inf, low=0, infinite=True) == math.inf


@pytest.mark.parametrize("value", [True, 1.0, "1", None])
def test_only_integers_are_integers(value: object) -> None:
    with pytest.raises(TypeError, match=r"n is .*: expected an integer >= 0 and <= 2"):
        checks.integer("n", value, low=0, high=2)
    assert checks.integer("n", np.uint8(2), low=0, high=2) == 2
    with pytest.raises(ValueError, match="n is 3"):
        checks.integer("n", 3, low=0, high=2)


def test_vectors_repeat_a_scalar_and_refuse_the_rest() -> None:
    assert checks.vector("v", 2, 3).tolist() == [2.0, 2.0, 2.0]
    cases: list[tuple[Any, type[Exception], str]] = [
        ([1, 2], ValueError, r"v has shape \(2,\): expected 3 numbers \(m\)"),
        ([1, 2, math.nan], ValueError, "finite"),
        ("abc", TypeError, "expected 3 numbers"),
        ([[1, 2], [3]], TypeError, "expected 3 numbers"),
        (None, ValueError, "finite"),
    ]
    for value, error, message in cases:
        with pytest.raises(error, match=message):
            checks.vector("v", value, 3, "m")


@pytest.mark.parametrize("scale", [1e-300, 1.0, 1e300])
def test_directions_of_any_length_become_unit_vectors(scale: float) -> None:
    # Squares of the ends of this range neither vanish nor overflow; two roundings of 1e-16.
    result = checks.direction("d", np.array([3.0, 0.0, 4.0]) * scale)
    np.testing.assert_allclose(result, [0.6, 0.0, 0.8], rtol=0, atol=1e-15)


def test_a_direction_without_length_is_refused() -> None:
    with pytest.raises(ValueError, match="non-zero length"):
        checks.direction("d", [0, 0, 0])


def test_colours_are_not_negative() -> None:
    assert checks.rgb("c", [0, 1, 2], "W").tolist() == [0.0, 1.0, 2.0]
    with pytest.raises(ValueError, match=r"c is \[0.0, -1.0, 0.0\]: .* >= 0 and <= 1e\+30 \(W\)"):
        checks.rgb("c", [0, -1, 0], "W")


def test_matrices_have_16_finite_numbers() -> None:
    assert checks.matrix4("m", np.eye(4, dtype=np.float32)).dtype == np.float64
    with pytest.raises(ValueError, match=r"shape \(3, 3\): expected \(4, 4\)"):
        checks.matrix4("m", np.eye(3))
    with pytest.raises(ValueError, match="not finite"):
        checks.matrix4("m", np.full((4, 4), np.inf))
    with pytest.raises(TypeError, match="dtype"):
        checks.matrix4("m", np.full((4, 4), "a"))


@pytest.mark.parametrize(
    ("value", "bounds", "message"),
    [
        (np.nan, {"low": 0, "high": 2, "unit": "m"}, r"nan: expected numbers >= 0 and <= 2 \(m\)"),
        (-1, {"low": 0}, "-1.0"),
        (np.inf, {"low": 0}, "inf"),
        (-np.inf, {"infinite": True}, "-inf"),
        (1e300, {}, "inf"),  # too large for float32
    ],
)
def test_planes_name_the_first_wrong_pixel(value: float, bounds: dict[str, Any], message: str) -> None:
    values = np.ones((3, 4))
    values[1, 2] = values[2, 3] = value
    with pytest.raises(ValueError, match=rf"p\[1, 2\] is {message}"):
        checks.plane("p", values, **bounds)


def test_planes_may_hold_infinity_where_it_is_allowed() -> None:
    assert checks.plane("p", [[np.inf]], low=0, infinite=True) == np.inf


@pytest.mark.parametrize(
    ("shape", "channels"), [((), None), ((3,), None), ((3, 4, 3), None), ((2, 3, 4, 3), None), ((2, 3, 4), 3)]
)
def test_planes_have_rows_columns_and_channels(shape: tuple[int, ...], channels: int | None) -> None:
    assert checks.plane("p", np.zeros((2, 3, 3)), channels=3).shape == (2, 3, 3)
    with pytest.raises(ValueError, match=rf"expected \(rows, columns{', 3' if channels else ''}\)"):
        checks.plane("p", np.zeros(shape), **({"channels": channels} if channels else {}))


def test_lists_have_a_width_and_may_be_empty() -> None:
    assert checks.plane_list("l", np.zeros((0, 3)), 3).shape == (0, 3)
    with pytest.raises(ValueError, match=r"expected \(count, 3\)"):
        checks.plane_list("l", np.zeros((3, 2)), 3)
    with pytest.raises(ValueError, match=r"l\[1, 0\] is nan"):
        checks.plane_list("l", [[0.0, 0.0], [math.nan, 0.0]], 2)
