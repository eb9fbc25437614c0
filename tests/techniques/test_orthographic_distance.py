"""Orthographic cameras: how far away they stand is arbitrary, and results do not depend on it.

A floor with tables is seen from above. All depths are multiples of 2^-10, which float32 holds up
to a distance of 2^14: the same surfaces give the same depths, moved by a number.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl import rasterize
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Material
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.filters.bilateral import Blur, bilateral_reference
from ssgi_cl.reference.filters.upsample import upsample_reference
from ssgi_cl.techniques.ao.slices import DEPTH_BIAS
from ssgi_cl.truth import metrics
from ssgi_cl.truth.layer_mesh import layer_mesh

from ..squares import squares

SIZE = (96, 128)
NEAR, FAR = 2.0, (200.0, 1000.0)
VIEW_HEIGHT = 6.0
RADIUS = 0.5
TABLE = 0.25
"""Height of the tables, scene units."""


def floor_with_tables(distance: float) -> GBuffer:
    """Return tables of two heights and a slope from a height above the floor."""
    camera = Camera.orthographic(
        (0, distance, 0), (0, 0, 0), (0, 0, -1), view_height=VIEW_HEIGHT, width=SIZE[1], height=SIZE[0], far=2e3
    )
    row, column = np.indices(SIZE)
    height = np.where((row // 16 % 2 == 1) & (column // 16 % 2 == 1), TABLE, 0.0)
    height = np.where((row // 24 % 2 == 1) & (column // 20 % 3 == 1), 0.03125, height)
    height += np.where(column > 96, (column - 96) / 64.0, 0.0)
    return GBuffer(camera=camera, depth=(distance - height).astype(np.float32))


def mask(gbuffer: GBuffer) -> NDArray[np.float32]:
    """Return 1 on the tables, 0 beside them and on the slope."""
    above = gbuffer.camera.position[1] - gbuffer.depth
    return np.asarray((above > 0.5 * TABLE) & (np.arange(SIZE[1]) <= 96), np.float32)


@pytest.mark.parametrize("distance", FAR)
@pytest.mark.parametrize(
    ("technique", "params"),
    [
        (gi.gtao, {"resolution": "full"}),
        (gi.gtao, {"resolution": "half", "blur_resolution": "full", "blur_radius": 4}),
        (gi.hbao, {"resolution": "quarter"}),
        (gi.bitmask_ao, {"resolution": "half"}),
        (gi.ssao, {"blur_radius": 4}),
    ],
)
def test_occlusion_is_the_same_from_any_distance(
    runtime: Runtime, technique: Callable[..., Any], params: dict[str, Any], distance: float
) -> None:
    near, far = (technique(floor_with_tables(d), radius=RADIUS, runtime=runtime, **params) for d in (NEAR, distance))
    assert near.min() < 0.97  # there is something to lose
    # Heights of 67 roundings of the depth count as none (ssao: 34), see `DEPTH_BIAS`, and the share of the
    # hemisphere below them is lost, and some more where normals are rebuilt. Measured at 1000: .0086 of .012.
    # bitmask_ao counts sectors, 32 a slice, of which the blur leaves about an eighth; measured at 200: .0036.
    sector = 1.0 / 256.0 if technique is gi.bitmask_ao else 0.0
    assert np.abs(near - far).max() <= 1.5 * DEPTH_BIAS * distance / RADIUS + sector


@pytest.mark.parametrize("distance", FAR)
@pytest.mark.parametrize("separable", [True, False])
def test_a_mask_is_blurred_alike_and_does_not_leak(runtime: Runtime, distance: float, separable: bool) -> None:
    near, far = (floor_with_tables(d) for d in (NEAR, distance))
    given = mask(near)
    blurs = [gi.bilateral_blur(given, g, radius=4, separable=separable, runtime=runtime) for g in (near, far)]
    # A distance from the plane is a difference of products of the depth with 35 / 6: 2^-24 of 1000 * 6 is 4e-4 of
    # the distance at which a weight ends.
    np.testing.assert_allclose(blurs[1], blurs[0], atol=1e-3)
    # At a table's corner the rebuilt normal is tilted, and 3 pixels on its plane is not far from the floor: .0043.
    assert np.abs(blurs[1] - given).max() < 0.01
    wanted = bilateral_reference(given, far, Blur(radius=4, separable=separable))
    np.testing.assert_allclose(blurs[1], wanted, atol=1e-3)


@pytest.mark.parametrize("distance", FAR)
@pytest.mark.parametrize("step", [2, 4])
def test_a_mask_is_upsampled_alike_and_does_not_leak(runtime: Runtime, distance: float, step: int) -> None:
    near, far = (floor_with_tables(d) for d in (NEAR, distance))
    given = mask(near)[::step, ::step]
    fine = [gi.upsample(given, g, step=step, runtime=runtime) for g in (near, far)]
    np.testing.assert_allclose(fine[1], fine[0], atol=1e-3)
    np.testing.assert_allclose(fine[1], upsample_reference(given, far, step=step), atol=1e-3)
    row, column = np.indices(SIZE)
    # Where a coarse pixel of the same surface is near: away from the right and the lower edges of tables.
    inner = (row % 16 < 16 - step) & (column % 16 < 16 - step) & (column < 96) & (row % 24 < 24 - step)
    assert np.abs(fine[1] - mask(far))[inner].max() < 1e-3


@pytest.mark.parametrize("distance", FAR)
def test_regions_and_joins_of_layers_are_the_same(distance: float) -> None:
    near, far = (floor_with_tables(d) for d in (NEAR, distance))
    found, wanted = metrics.regions(far), metrics.regions(near)
    assert wanted["silhouettes"].any()
    for name, region in wanted.items():
        np.testing.assert_array_equal(found[name], region, err_msg=name)
    joined = [layer_mesh(gbuffer, "surface") for gbuffer in (near, far)]
    assert joined[0] is not None
    assert joined[1] is not None
    np.testing.assert_array_equal(joined[1].triangles, joined[0].triangles)


@pytest.mark.parametrize("distance", FAR)
def test_layers_close_to_one_another_are_peeled_alike(runtime: Runtime, distance: float) -> None:
    thin = 2.0**-10  # 16 times what layers of this view are apart at least, and less than 1e-5 of a depth of 1000
    scene = squares((0.0, 0.0, 1.0, Material()), (0.0, -thin, 2.0, Material()))
    camera = Camera.orthographic((0, 0, distance), (0, 0, 0), view_height=VIEW_HEIGHT, width=48, height=48, far=2e3)
    drawn = rasterize.gbuffer(scene, camera, layers=2, runtime=runtime)
    depth = distance - np.asarray(drawn.depth)
    middle = depth[:, 20:28, 20:28]
    np.testing.assert_allclose(middle[0], 0.0, atol=distance * 2.0**-23)
    np.testing.assert_allclose(middle[1], -thin, atol=distance * 2.0**-23)
