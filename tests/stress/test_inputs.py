"""Arrays of G-buffers: any real dtype and any strides, converted by rule or refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.checks import LEAST_DEPTH, MOST_DEPTH
from ssgi_cl.core.gbuffer import GBuffer

from .test_finite import examples

SIZE = (5, 7)
CAMERA = Camera.look_at((0, 0, 1), (0, 0, 0), width=SIZE[1], height=SIZE[0])

anything = st.one_of(st.floats(width=64), st.sampled_from((np.nan, np.inf, -np.inf, 0.0, -0.0, 5e-324, 1e-40, 3e38)))


def laid_out(array: NDArray[Any], way: str) -> NDArray[Any]:
    """Return an equal array with another layout in memory."""
    match way:
        case "columns":
            return np.asfortranarray(array)
        case "reversed":
            return np.ascontiguousarray(array[::-1, ::-1])[::-1, ::-1]
        case "strided":
            return np.repeat(np.repeat(array, 2, axis=0), 3, axis=1)[::2, ::3]
        case "read-only":
            array = array.copy()
            array.flags.writeable = False
            return array
        case "repeated":
            return np.broadcast_to(array[:1], array.shape)
        case "foreign":
            return array.astype(array.dtype.newbyteorder())
    return array


@pytest.mark.parametrize("way", ["plain", "columns", "reversed", "strided", "read-only", "repeated", "foreign"])
@pytest.mark.parametrize("dtype", ["f2", "f4", "f8", "i4", "u1", "longdouble"])
def test_any_real_dtype_and_layout_is_taken_and_left_as_it_is(rng: np.random.Generator, dtype: str, way: str) -> None:
    whole = (rng.random((*SIZE, 3)) * 2.0 + 1.0).astype(dtype)
    depth, light = laid_out(whole[..., 0], way), laid_out(whole, way)
    before = depth.copy()
    gbuffer = GBuffer(camera=CAMERA, depth=depth, emission=light)
    for taken, given_array in ((gbuffer.depth, depth), (gbuffer.emission, light)):
        assert isinstance(taken, np.ndarray)
        assert taken.dtype == np.float32
        assert taken.flags.c_contiguous
        np.testing.assert_array_equal(taken, given_array.astype(np.float32))
    np.testing.assert_array_equal(depth, before)


@pytest.mark.parametrize("dtype", [bool, complex, object, "U3", "m8[s]"])
def test_what_is_not_real_is_refused(dtype: Any) -> None:
    with pytest.raises(TypeError, match=r"depth has dtype .*: expected a real"):
        GBuffer(camera=CAMERA, depth=np.ones(SIZE, np.int64).astype(dtype))


@examples(100)
@given(depth=arrays.arrays(np.float64, SIZE, elements=anything))
def test_depths_are_taken_within_limits_or_refused(depth: NDArray[np.float64]) -> None:
    if np.isnan(depth).any() or (depth <= 0.0).any():
        with pytest.raises(ValueError, match=r"depth\[\d+, \d+\] is .*: expected numbers > 0"):
            GBuffer(camera=CAMERA, depth=depth)
        return
    taken = np.asarray(GBuffer(camera=CAMERA, depth=depth).depth)
    np.testing.assert_array_equal(np.isinf(taken), np.isinf(depth))
    there = np.isfinite(depth)
    wanted = np.clip(depth[there], LEAST_DEPTH, MOST_DEPTH)
    np.testing.assert_allclose(taken[there], wanted, rtol=1e-7)  # float32 and its ends


@examples(100)
@given(normal=arrays.arrays(np.float64, (*SIZE, 3), elements=anything))
def test_normals_become_unit_vectors_or_are_refused(normal: NDArray[np.float64]) -> None:
    with np.errstate(over="ignore"):
        rounded = normal.astype(np.float32)
    if not np.isfinite(rounded).all():
        with pytest.raises(ValueError, match=r"normal\[\d+, \d+, \d\] is .*: expected numbers"):
            GBuffer(camera=CAMERA, depth=np.ones(SIZE), normal=normal)
        return
    taken = np.asarray(GBuffer(camera=CAMERA, depth=np.ones(SIZE), normal=normal).normal)
    length = np.linalg.norm(taken.astype(np.float64), axis=-1)
    # Lengths within 5e-6 of 1 are left alone.
    np.testing.assert_allclose(length, rounded.any(axis=-1), atol=1e-5)


@examples(100)
@given(albedo=arrays.arrays(np.float32, (*SIZE, 3), elements=st.floats(width=32)))
def test_albedo_out_of_range_is_refused(albedo: NDArray[np.float32]) -> None:
    if ((albedo >= 0.0) & (albedo <= 1.0)).all():
        GBuffer(camera=CAMERA, depth=np.ones(SIZE), albedo=albedo)
        return
    with pytest.raises(ValueError, match=r"albedo\[\d+, \d+, \d\] is .*: expected numbers >= 0"):
        GBuffer(camera=CAMERA, depth=np.ones(SIZE), albedo=albedo)
