"""Sums of thousands of lights: the techniques against float64, and the ways to sum."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ssgi_cl.device.runtime import Runtime
from tools.figures import summation

MOST = 1e-5
"""Relative error of a pixel's irradiance."""


@pytest.mark.parametrize("terms", summation.TERMS)
def test_blocks_err_little_whatever_the_terms(terms: str) -> None:
    values = summation.TERMS[terms](1 << 16).astype(np.float32)
    right = math.fsum(values.astype(np.float64))
    errors = {name: abs(total(values) / right - 1.0) for name, total in summation.SUMS.items()}
    assert errors["blocks"] < MOST
    assert errors["pairwise"] < 1e-6
    assert errors["compensated"] < 1e-6
    assert errors["plain"] > 4.0 * errors["blocks"]


def test_more_lights_than_a_batch_are_summed_right(runtime: Runtime) -> None:
    # 3025 lights: two batches, the second of which is added to what is there.
    for name, error in summation.technique_errors(runtime, summation.bright_first(55 * 55)):
        assert error < MOST, name


@pytest.mark.slow
@pytest.mark.parametrize("side", summation.SIDES)
@pytest.mark.parametrize("terms", summation.TERMS)
def test_thousands_of_lights_are_summed_right(variant_runtime: Runtime, terms: str, side: int) -> None:
    flux = summation.TERMS[terms](side * side)
    for name, error in summation.technique_errors(variant_runtime, flux):
        assert error < MOST, name
