"""Regions of an image: where scenes have them, each pixel in one, margins and smallest images."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.truth.image_regions import REGIONS, regions, smooth_surfaces


def view(rows: int = 60, columns: int = 80) -> Camera:
    return Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.9, width=columns, height=rows)


def test_smooth_surfaces_end_3_pixels_from_edges_and_have_400_pixels() -> None:
    camera = view(120, 160)
    depth = np.full((120, 160), 4.0)
    normal = np.tile(np.array((0.0, 0.0, 1.0)), (120, 160, 1))
    albedo = np.full((120, 160, 3), 0.5)
    depth[:, 40:] = 3.0  # a silhouette
    albedo[:60] = (0.5, 0.36, 0.5)  # less than three quarters of the green
    normal[:, 100:126] = (0.0, 1.0, 0.0)  # creases; 18 columns are left, two times 57 x 18 pixels
    depth[:, 150:] = np.inf
    normal[:, 150:] = 0.0
    found = smooth_surfaces(GBuffer(camera=camera, depth=depth, normal=normal, albedo=albedo))
    expected = np.ones((120, 160), np.bool_)
    for column in (40, 100, 126, 150):
        expected[:, column - 4 : column + 4] = False
    expected[56:64] = False
    expected[:, 150:] = False
    np.testing.assert_array_equal(found, expected)
    albedo[:60] = (0.5, 0.38, 0.5)
    normal[:, 100:126] = (0.0, 0.0, 1.0)
    normal[:, 100:115] = (0.0, 1.0, 0.0)
    # One surface again, but what lies between the creases is too narrow: 7 x 56 pixels above and below.
    depth[56:64] = np.inf
    found = smooth_surfaces(GBuffer(camera=camera, depth=depth, normal=normal, albedo=albedo))
    assert not found[:, 96:119].any()
    assert found[:52, 50:90].all()


@pytest.mark.parametrize("with_normals", [True, False])
def test_tilted_plane_has_a_border_and_nothing_else(with_normals: bool) -> None:
    camera = view()
    _, sy, _, oy = camera.pixel_to_view
    y = sy * (np.arange(60) + 0.5) + oy
    depth = np.repeat((2.0 / (1.0 - 1.5 * y))[:, None], 80, axis=1)  # z = -2 - 1.5 y
    normal = np.tile(np.array((0.0, 1.5, 1.0)) / math.hypot(1.5, 1.0), (60, 80, 1))
    found = regions(GBuffer(camera=camera, depth=depth, normal=normal if with_normals else None))
    assert tuple(found) == REGIONS
    assert found["border"].sum() == 60 * 80 - 54 * 74  # 5 % of 60 rows: 3 pixels
    assert found["elsewhere"].sum() == 54 * 74


def test_a_floor_seen_at_a_slant_meets_a_wall_without_a_silhouette() -> None:
    # The wall is 5 away, the floor .03 below the eye: from the crease to the next row the floor's
    # depth changes by more than a metre, and no wall's pixel lies in the floor's plane. But the
    # floor's pixels lie within a pixel's width of the crease, so off one plane by next to nothing.
    camera = view()
    _, sy, _, oy = camera.pixel_to_view
    slope = np.broadcast_to((sy * (np.arange(60) + 0.5) + oy)[:, None], (60, 80))
    floor = np.where(slope < 0.0, -0.03 / np.minimum(slope, -1e-9), np.inf)
    depth = np.minimum(floor, 5.0)
    normal = np.where((floor < 5.0)[..., None], (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    found = regions(GBuffer(camera=camera, depth=depth, normal=normal))
    assert np.ptp(depth[29:31], axis=0).min() > 1.0
    assert not found["silhouettes"].any()
    assert found["creases"][29:31, 5:75].all()


def stepped() -> GBuffer:
    """A wall at 4 with a box at 3 before it, a bar of 2 columns at 3, a fold, and some sky."""
    camera = view()
    depth = np.full((60, 80), 4.0)
    normal = np.tile(np.array((0.0, 0.0, 1.0)), (60, 80, 1))
    depth[10:30, 10:30] = 3.0
    depth[8:52, 50:52] = 3.0
    normal[45:, :40] = (0.0, 1.0, 0.0)
    depth[:20, 65:] = np.inf
    normal[:20, 65:] = 0.0
    return GBuffer(camera=camera, depth=depth, normal=normal)


def test_each_surface_pixel_is_in_exactly_one_region() -> None:
    gbuffer = stepped()
    found = regions(gbuffer)
    total = sum(mask.astype(int) for mask in found.values())
    np.testing.assert_array_equal(total, np.isfinite(np.asarray(gbuffer.depth)).astype(int))


def test_regions_lie_where_the_scene_has_them() -> None:
    found = regions(stepped())
    np.testing.assert_array_equal(found["silhouettes"][5:40, 5:40], grown_box()[5:40, 5:40])
    np.testing.assert_array_equal(np.unique(np.nonzero(found["thin"])[1]), [50, 51])
    np.testing.assert_array_equal(np.unique(np.nonzero(found["thin"])[0]), np.arange(8, 52))
    fold = np.arange(45 - 4, 45 + 4)  # the two rows that meet, and 3 more on both sides
    np.testing.assert_array_equal(np.nonzero(found["creases"][:, 20])[0], fold)
    assert found["silhouettes"][10, 64]  # beside the sky
    assert found["silhouettes"][22, 70]  # below the sky
    assert found["elsewhere"][20, 20]  # on the box


def grown_box() -> Any:
    """Pixels within 3 of the two rings on both sides of the rim of the box of `stepped`."""
    box = np.zeros((60, 80), np.bool_)
    box[10:30, 10:30] = True
    near = np.zeros_like(box)
    rows, columns = np.indices(box.shape)
    for r, c in np.argwhere(box):
        for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            if not box[r + dr, c + dc]:
                for at in ((r, c), (r + dr, c + dc)):
                    near |= (abs(rows - at[0]) <= 3) & (abs(columns - at[1]) <= 3)
    return near


def test_regions_ignore_the_margin_and_deeper_layers() -> None:
    plain = stepped()
    depth = np.pad(np.asarray(plain.depth), ((2, 2), (4, 4)), constant_values=1.0)
    normal = np.pad(np.asarray(plain.normal), ((2, 2), (4, 4), (0, 0)), constant_values=0.5)
    layered = GBuffer(camera=plain.camera, depth=np.stack([depth, depth + 1]), normal=normal)
    one, two = regions(plain), regions(layered)
    for name in REGIONS:
        np.testing.assert_array_equal(one[name], two[name])


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (3, 2)])
def test_smallest_images_are_all_border(shape: tuple[int, int]) -> None:
    camera = view(*shape)
    for depth in (np.ones(shape), np.full(shape, np.inf)):
        found = regions(GBuffer(camera=camera, depth=depth))
        inner = (shape[0] - 2) * (shape[1] - 2) if min(shape) > 2 else 0
        assert found["border"].sum() == np.isfinite(depth).sum() - inner
