"""Environments as images of ever fewer texels."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from ssgi_cl.core.lights import Environment
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.sky_levels import MOST_ROWS, SkyLevels, levels


def mean(image: np.ndarray) -> np.ndarray:
    """Return the mean over the sphere."""
    edges = np.linspace(0.0, math.pi, len(image) + 1)
    weight = np.cos(edges[:-1]) - np.cos(edges[1:])
    return np.einsum("r,rcx->x", weight, image) / (weight.sum() * image.shape[1])


@pytest.mark.parametrize("size", [(1, 1), (8, 16), (64, 32), (512, 1024)], ids=str)
def test_every_level_has_the_mean_of_the_sphere(rng: np.random.Generator, size: tuple[int, int]) -> None:
    sky = rng.random((*size, 3)) ** 4
    images = levels(sky)
    assert images[0].shape[0] == min(size[0], MOST_ROWS)
    assert images[-1].shape[0] == 1
    for image in images:
        np.testing.assert_allclose(mean(image), mean(sky), rtol=1e-9)
    for fine, coarse in itertools.pairwise(images):
        assert coarse.shape[0] == fine.shape[0] // 2


@pytest.mark.parametrize("size", [(7, 13), (1, 1001), (301, 1), (255, 511)], ids=str)
def test_odd_sizes_keep_their_range(rng: np.random.Generator, size: tuple[int, int]) -> None:
    sky = 1.0 + rng.random((*size, 3))
    for image in levels(sky):
        assert image.min() >= sky.min() - 1e-12
        assert image.max() <= sky.max() + 1e-12
        # A row or column that counts twice is one of few.
        np.testing.assert_allclose(mean(image), mean(sky), rtol=0.2)


def test_levels_on_the_device(runtime: Runtime) -> None:
    sky = SkyLevels(runtime)
    assert sky.count == 0
    sky.set([Environment((1.0, 2.0, 3.0))])
    assert sky.count == 1
    np.testing.assert_array_equal(sky.texels.download(), np.float32((1, 2, 3)))
    image = np.random.default_rng(1).random((8, 16, 3))
    environment = Environment(image)
    both = [environment, Environment((1.0, 0.0, 0.0))]
    sky.set(both)
    first, rows, columns = sky.places.download().reshape(-1, 3)[0].tolist()
    found = sky.texels.download()[first : first + rows * columns * 3].reshape(rows, columns, 3)
    np.testing.assert_allclose(found, image + np.array((1.0, 0.0, 0.0)), rtol=1e-6)
    kept = sky.texels
    sky.set(both)
    assert sky.texels is kept
    assert sky.count == 4
    sky.set([])
    assert sky.count == 0
