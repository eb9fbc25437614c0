"""Cleaning of measured depth: planes come back, edges stay, holes are filled as far as asked."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi

SIZE = (48, 64)
NOISE = 0.0015


def room() -> Any:
    """Depth of a tilted floor, linear in 1 / depth, with a box before it."""
    rows = np.arange(SIZE[0])[:, None] / SIZE[0]
    depth = 1.0 / np.broadcast_to(0.25 + 0.25 * rows, SIZE)
    return np.where(inside(), 1.8, depth)


def inside() -> Any:
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    return (abs(rows - 24) < 10) & (abs(columns - 32) < 12)


@pytest.fixture
def noisy(rng: np.random.Generator) -> Any:
    return room() + NOISE * room() ** 2 * rng.standard_normal(SIZE)


def off(depth: Any, where: Any = True) -> float:
    error = np.abs(1.0 / np.asarray(depth) - 1.0 / room())
    return float(np.sqrt(np.mean(error[np.broadcast_to(where, SIZE)] ** 2)))


def test_noise_is_averaged_along_surfaces(noisy: Any) -> None:
    cleaned = gi.clean_depth(noisy)
    assert cleaned.dtype == np.float32
    # Weights of some 50 pixels: a seventh of the noise, a quarter at borders. Measured: .19.
    assert off(cleaned) < 0.3 * off(noisy)
    # A plane has no edge to lose: the step of the box stays where it is.
    assert (np.abs(cleaned[inside()] - 1.8) < 0.02).all()


def test_exact_planes_stay_as_they_are() -> None:
    np.testing.assert_allclose(gi.clean_depth(room(), noise=NOISE), room(), rtol=2e-3)  # across the box's edge
    np.testing.assert_allclose(gi.clean_depth(room()), room(), rtol=1e-4)


def test_the_noise_is_estimated(noisy: Any) -> None:
    np.testing.assert_allclose(gi.clean_depth(noisy), gi.clean_depth(noisy, noise=NOISE), rtol=5e-3)


def test_holes_are_filled_up_to_the_distance(noisy: Any) -> None:
    holed = noisy.copy()
    holed[30:33, 5:8] = 0.0
    holed[:, 50:] = np.nan
    cleaned = gi.clean_depth(holed, fill=4)
    np.testing.assert_allclose(cleaned[30:33, 5:8], room()[30:33, 5:8], rtol=0.01)
    assert np.isfinite(cleaned[:, :54]).all()
    assert np.isinf(cleaned[:, 54:]).all()
    assert np.isinf(gi.clean_depth(holed, fill=0)[31, 6])


def test_batches_and_kinds(noisy: Any) -> None:
    single = noisy.astype(np.float32)
    one = gi.clean_depth(single)
    both = gi.clean_depth(np.stack([single, single]))
    np.testing.assert_array_equal(both[1], one)
    assert isinstance(gi.clean_depth(memoryview(single)), memoryview)
    assert np.isinf(gi.clean_depth(np.zeros((4, 5)))).all()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"reach": 0}, "reach is 0: expected an integer >= 1 and <= 32"),
        ({"noise": 0.0}, "noise is 0.0: expected a number > 0"),
        ({"fill": -1}, "fill is -1: expected an integer >= 0"),
    ],
)
def test_bad_arguments_are_named(noisy: Any, given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        gi.clean_depth(noisy, **given)
    with pytest.raises(ValueError, match=r"depth has shape \(3,\) of float64: expected \(rows, columns\)"):
        gi.clean_depth(np.ones(3))
