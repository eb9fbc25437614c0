"""Random numbers and directions: their distribution, and that they stay the same."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ssgi_cl.core.sampling import basis, directions, hashed, r2_points, r_points, wrapped

COUNT = 1 << 16


def test_points_fill_the_square_evenly_from_any_start() -> None:
    for first in (0, 1000):
        points = r2_points(first, first + 4096)
        assert points.min() >= 0.0
        assert points.max() < 1.0
        cells, _, _ = np.histogram2d(*points.T, bins=16, range=((0, 1), (0, 1)))
        # 16 points a cell; at random some of 256 cells would have 4, others 30.
        assert cells.min() >= 12
        assert cells.max() <= 20
    np.testing.assert_array_equal(r2_points(0, 20)[7:], r2_points(7, 20))  # they go on where they stopped


@pytest.mark.parametrize(("dimensions", "root"), [(1, 1.618033988749895), (2, 1.324717957244746)])
def test_steps_of_the_sequence_are_powers_of_its_root(dimensions: int, root: float) -> None:
    # The golden ratio, the plastic number: to 15 digits, as float64 has them.
    expected = np.mod(root ** -np.arange(1.0, dimensions + 1.0), 1.0)
    np.testing.assert_allclose(r_points(0, 1, dimensions)[0], expected, rtol=1e-14)


@pytest.mark.parametrize("seed", [0, 1, 2**63 - 1])
def test_hashed_numbers_are_uniform_and_independent(seed: int) -> None:
    numbers = hashed(np.arange(COUNT, dtype=np.uint64), seed).astype(np.float64)
    assert numbers.min() >= 0.0
    assert numbers.max() < 1.0
    counts = np.histogram(numbers, bins=64, range=(0, 1))[0]
    expected = COUNT / 64
    # Chi squared with 63 degrees of freedom: mean 63, standard deviation 11; five of these.
    assert np.sum((counts - expected) ** 2) / expected < 63 + 5 * 11.2
    # Neighbours, and the same key under the next seed: 0 with a standard error of 0.004.
    other = hashed(np.arange(COUNT, dtype=np.uint64), seed ^ 1)
    assert abs(np.corrcoef(numbers[1:], numbers[:-1])[0, 1]) < 0.02
    assert abs(np.corrcoef(numbers, other)[0, 1]) < 0.02
    np.testing.assert_array_equal(wrapped(np.float32([0.0, 0.25, 1.0, 1.75])), [0.0, 0.25, 0.0, 0.75])


def test_basis_is_orthonormal_for_any_axis(rng: np.random.Generator) -> None:
    axis = np.concatenate([rng.standard_normal((1000, 3)), np.eye(3), -np.eye(3)])
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    frame = np.stack(basis(axis.astype(np.float32)), axis=1).astype(np.float64)
    products = frame @ frame.transpose(0, 2, 1)
    # Some roundings of float32, 6e-8 each.
    np.testing.assert_allclose(products, np.broadcast_to(np.eye(3), products.shape), atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(frame), 1.0, atol=1e-6)


@pytest.mark.parametrize(("weighting", "power"), [("cosine", 2.0), ("uniform", 1.0)])
def test_directions_have_the_density_of_their_weighting(weighting: str, power: float) -> None:
    axis = np.array([[0.48, -0.6, 0.64]], np.float32)
    u, v = r2_points(0, COUNT).T[..., None]
    way = directions(u, v, basis(axis), weighting)[:, 0].astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(way, axis=-1), 1.0, atol=1e-6)  # roundings
    height = way @ axis[0].astype(np.float64)
    # Height above the surface is the square root of a uniform number ("cosine") or one itself.
    share = np.sort(height) ** power
    np.testing.assert_allclose(share, (np.arange(COUNT) + 0.5) / COUNT, atol=1e-4)  # well spread
    east = np.arctan2(way @ basis(axis)[1][0], way @ basis(axis)[0][0])
    counts = np.histogram(east, bins=16, range=(-math.pi, math.pi))[0]
    np.testing.assert_allclose(counts, COUNT / 16, rtol=0.01)  # well spread
