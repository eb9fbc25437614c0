"""Light on photographs and depth maps: closed forms on a wall, shadows, batches."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.relight import ALBEDO

SIZE = (24, 32)
SUN = gi.DirectionalLight((0.0, 0.0, -1.0), (3.0, 2.0, 1.0))  # along the view
CAMERA = gi.Camera.from_intrinsics(30.0, 30.0, 16.0, 12.0, width=SIZE[1], height=SIZE[0])


def wall(**arrays: Any) -> gi.GBuffer:
    return gi.GBuffer(camera=CAMERA, depth=np.full(SIZE, 2.0, np.float32), **arrays)


def test_light_is_added_to_an_image_or_takes_its_place(runtime: Runtime) -> None:
    image = np.full((*SIZE, 3), 0.25, np.float32)
    albedo = np.full((*SIZE, 3), 0.5, np.float32)
    gbuffer = wall(albedo=albedo)
    added = np.array([3.0, 2.0, 1.0]) * 0.5 / np.pi  # a wall that faces the light, and no other surface
    found = gi.relight(gbuffer, image, [SUN], runtime=runtime)
    np.testing.assert_allclose(found, np.broadcast_to(0.25 + added, found.shape), rtol=1e-4)
    found = gi.relight(gbuffer, image, [SUN], replaced=True, runtime=runtime)
    np.testing.assert_allclose(found, np.broadcast_to(added, found.shape), rtol=1e-4)


def test_an_image_stands_for_its_albedo(runtime: Runtime) -> None:
    photograph = np.full((*SIZE, 3), 128, np.uint8)
    found = gi.relight(wall(), photograph, [SUN], replaced=True, runtime=runtime)
    np.testing.assert_allclose(found[5, 5], np.array([3.0, 2.0, 1.0]) * ALBEDO / np.pi, rtol=1e-4)


def test_a_box_hides_the_light_from_the_wall_behind(runtime: Runtime) -> None:
    depth = np.full(SIZE, 2.0, np.float32)
    depth[8:16, 12:20] = 1.7
    gbuffer = replace(wall(), depth=depth)
    slanted = gi.DirectionalLight((1.0, 0.0, -1.0), 1.0)  # from the left: the shadow falls to the right
    found = gi.relight(gbuffer, np.zeros((*SIZE, 3)), [slanted], radius=1.0, replaced=True, runtime=runtime)
    # Albedo of a black image is 0: the light shows on a white one.
    white = np.ones((*SIZE, 3))
    assert not found.any()
    found = gi.relight(gbuffer, white, [slanted], radius=1.0, replaced=True, runtime=runtime)[..., 0]
    assert found[12, 21:23].mean() < 0.6 * found[12, 4:8].mean()


def test_where_nothing_is_there_the_image_stays(runtime: Runtime) -> None:
    depth = np.full(SIZE, 2.0, np.float32)
    depth[:5] = np.inf
    image = np.full((*SIZE, 3), 0.25, np.float32)
    found = gi.relight(replace(wall(), depth=depth), image, [SUN], runtime=runtime)
    np.testing.assert_array_equal(found[:5], 0.25)


def test_a_relief_is_a_picture_of_the_kind_of_the_depth(runtime: Runtime) -> None:
    depth = np.full(SIZE, 2.0, np.float32)
    depth[8:16, 12:20] = np.linspace(1.7, 1.99, 8)
    one = gi.shade_depth(depth, yfov=0.8, runtime=runtime)
    assert (one.shape, one.dtype) == ((*SIZE, 3), np.uint8)
    assert one.std() > 2.0
    both = gi.shade_depth(np.stack([depth, depth]), yfov=0.8, runtime=runtime)
    np.testing.assert_array_equal(both[1], one)
    assert isinstance(gi.shade_depth(memoryview(depth), yfov=0.8, runtime=runtime), memoryview)


def test_normals_of_a_tilted_plane(runtime: Runtime) -> None:
    view = gi.Camera.look_at((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), width=32, height=24)
    sx, sy, ox, oy = view.pixel_to_view
    x, y = sx * (np.arange(32) + 0.5) + ox, sy * (np.arange(24)[:, None] + 0.5) + oy
    rays = np.stack([*np.broadcast_arrays(x, y, -1.0)], axis=-1) @ view.view[:3, :3]
    depth = (-view.position[1] / rays[..., 1]).astype(np.float32)  # the plane y = 0
    gbuffer = gi.GBuffer(camera=view, depth=np.where(depth > 0.0, depth, np.inf))
    found = gi.normals_from_depth(gbuffer, runtime=runtime)
    there = np.isfinite(np.asarray(gbuffer.depth))
    np.testing.assert_allclose(found[there], np.tile([0.0, 1.0, 0.0], (int(there.sum()), 1)), atol=2e-3)
    np.testing.assert_array_equal(found[~there], 0.0)


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.ones((3, 3, 3)), r"image has shape \(3, 3, 3\): expected \(24, 32, 3\) as the G-buffer"),
        (np.full((*SIZE, 3), -1.0), r"image\[0, 0, 0\] is -1.0: expected numbers >= 0"),
    ],
)
def test_images_that_do_not_fit_are_named(runtime: Runtime, image: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        gi.relight(wall(), image, [SUN], runtime=runtime)
