"""Patterns that techniques sample with against those that reference implementations define."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from ssgi_cl.core.sampling import TILE_ORDER
from ssgi_cl.core.vpls import cut_evenly
from ssgi_cl.reference import patterns
from ssgi_cl.reference.ao.bitmask_ao import taps_of
from ssgi_cl.reference.ao.occlusion import blur_of
from ssgi_cl.reference.multires.multires_grid import bound_share
from ssgi_cl.reference.rsm import rsm
from ssgi_cl.reference.vpl.vpl_splat import lobe_share as lobe_share_reference
from ssgi_cl.reference.vpl.vpls import cut_evenly as cut_evenly_reference
from ssgi_cl.techniques.ao.bitmask import BitmaskParams
from ssgi_cl.techniques.ao.gtao import GtaoParams
from ssgi_cl.techniques.ao.hbao import HbaoParams
from ssgi_cl.techniques.ao.slices import SliceParams, pattern
from ssgi_cl.techniques.ao.ssao import SsaoParams, reflected_points, sample_points
from ssgi_cl.techniques.direct.light_shadows import tile_pattern
from ssgi_cl.techniques.multires.multires_grid import bound_scale
from ssgi_cl.techniques.rsm import rsm_samples
from ssgi_cl.techniques.vpl.flux_curve import hilbert_order
from ssgi_cl.techniques.vpl.packed_vpls import lobe_share


def assert_equal(found: ArrayLike, wanted: ArrayLike) -> None:
    """Both are float64 with some roundings each, of values of about 1."""
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)


def test_bayers_matrix_is_the_one_that_textbooks_print() -> None:
    printed = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]]
    np.testing.assert_array_equal(patterns.bayer(), printed)
    np.testing.assert_array_equal(TILE_ORDER, printed)


@pytest.mark.parametrize(
    "params",
    [
        SliceParams(),
        SliceParams(slices=1, taps=1),
        SliceParams(slices=5, taps=7, tap_power=2.0),
        GtaoParams(),
        HbaoParams(slices=3),
        BitmaskParams(),
        BitmaskParams(joined=False, taps=5),
        GtaoParams(frame=1),
        BitmaskParams(slices=1, frame=1000),
        BitmaskParams(checkerboard=True),
        GtaoParams(checkerboard=True, slices=3, frame=2),
    ],
)
def test_slices_turn_and_taps_shift_as_hammersleys_points_say(params: SliceParams) -> None:
    made, wanted = pattern(params), patterns.slice_pattern(params)
    assert_equal(made.angle, wanted.angle)
    assert_equal(made.share, wanted.share)
    assert_equal(made.dither, wanted.dither)


@pytest.mark.parametrize(("count", "power"), [(1, 0.5), (16, 0.5), (5, 1.0 / 3.0)])
def test_points_of_ssao_are_the_r3_sequence_reflected(count: int, power: float) -> None:
    assert_equal(sample_points(3 * count, power), patterns.ball_points(3 * count, power))
    assert_equal(reflected_points(count, power), patterns.reflected_points(count, power))


def test_lights_are_sampled_along_a_spiral() -> None:
    points, shift = patterns.tile_disk()
    found = tile_pattern()
    assert_equal(found[0], points)
    assert_equal(found[1], shift)


@pytest.mark.parametrize("count", [1, 7, 64])
def test_samples_of_maps_lie_where_the_paper_has_them(count: int) -> None:
    assert_equal(rsm_samples.square_points(count), patterns.square_points(count))
    for weights in ("unbiased", "paper"):
        assert_equal(rsm_samples.disk_pattern(count, weights), patterns.disk_pattern(count, weights))
        for reach in (0.3, np.pi):
            assert_equal(rsm_samples.cap_pattern(count, weights, reach), patterns.cap_pattern(count, weights, reach))
    assert_equal(rsm_samples.tile_turns(), patterns.tile_turns())
    assert_equal(rsm_samples.cube_turns(), rsm.face_rotations())


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (4, 4), (7, 12), (33, 20)])
def test_hilberts_curve_is_made_of_four_of_half_its_size(size: tuple[int, int]) -> None:
    np.testing.assert_array_equal(hilbert_order(*size), rsm.hilbert_order(*size))


def test_a_full_hilbert_curve_goes_from_neighbour_to_neighbour() -> None:
    row, column = np.divmod(rsm.hilbert_order(16, 16), 16)
    np.testing.assert_array_equal(np.abs(np.diff(row)) + np.abs(np.diff(column)), 1)
    assert sorted(zip(row, column, strict=True)) == list(np.ndindex(16, 16))


@pytest.mark.parametrize("count", [1, 9, 100, 300])
def test_rows_are_cut_alike(count: int, rng: np.random.Generator) -> None:
    amounts = rng.random((4, 100)) + 1e-3
    importance = rng.random(100) + 0.5
    found = cut_evenly(amounts, count, importance)
    wanted = cut_evenly_reference(amounts.T, count, importance)
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)


def test_lobes_are_cut_off_by_their_surface_alike(rng: np.random.Generator) -> None:
    gloss, cosine = 10.0 ** rng.uniform(0.0, 3.0, 50), rng.uniform(-0.2, 1.0, 50)
    wanted = [lobe_share_reference(n, c) for n, c in zip(gloss, cosine, strict=True)]
    assert_equal(lobe_share(gloss, cosine), wanted)


def test_bounds_of_levels_are_a_power_of_the_step() -> None:
    for step in (1, 2, 4, 8, 16, 32):
        assert bound_scale(step) == pytest.approx(bound_share(step), rel=1e-12)


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"resolution": "half"},
        {"resolution": "quarter", "blur_resolution": "full"},
        {"blur_radius": 4, "blur_passes": 2},
    ],
)
@pytest.mark.parametrize("kind", [SsaoParams, GtaoParams, BitmaskParams])
def test_blurs_are_those_that_parameters_ask_for(kind: Any, fields: dict[str, Any]) -> None:
    params = kind(**fields)
    made, wanted = params.blur, blur_of(params)
    for name in ("radius", "passes", "depth_sigma", "normal_sigma", "sigma", "separable"):
        assert getattr(made, name) == pytest.approx(getattr(wanted, name)), name


@pytest.mark.parametrize("joined", [True, False])
@pytest.mark.parametrize("layers", [1, 2, 3, 4])
def test_layers_share_their_taps_alike(layers: int, joined: bool) -> None:
    for taps in (1, 14, 40, 64):
        params = BitmaskParams(taps=taps, joined=joined)
        found = params.in_front_of(layers).taps, params.deeper(layers)
        assert found == taps_of(params, layers)
