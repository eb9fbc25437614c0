"""Rays against what depth layers hold: closed forms, the mesh where all is in view, and joins."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.view import gbuffer
from ssgi_cl.truth import ambient_occlusion, layered_occlusion, metrics
from ssgi_cl.truth.layer_mesh import JOINS, layer_mesh

from ..closed_forms import hidden_by_wall, quads, with_mesh
from ..techniques.analytic import CAMERAS, Plane, camera, tilted, trace
from ..techniques.walls import wall_and_floor

pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")

Doubles = NDArray[np.float64]


# ---- closed forms


@pytest.mark.parametrize(
    ("kind", "degrees"),
    [*((kind, 50) for kind in CAMERAS), ("perspective", 0), ("perspective", 85), ("orthographic", 85)],
)
def test_a_plane_at_any_tilt_is_open_without_error(kind: str, degrees: float) -> None:
    seen_by = camera(kind, size=(23, 31))
    seen = trace(seen_by, [tilted(seen_by, degrees)], margin=(4, 6))
    for joins in JOINS:
        truth = layered_occlusion(seen, math.inf, 32, joins=joins)
        np.testing.assert_array_equal(truth.mean, 1.0)
        np.testing.assert_array_equal(truth.error, 0.0)


@pytest.mark.parametrize(
    ("kind", "weighting", "rays"),
    [
        ("perspective", "cosine", 64),
        pytest.param("orthographic", "uniform", 256, marks=pytest.mark.slow),
        pytest.param("perspective", "uniform", 256, marks=pytest.mark.slow),
        pytest.param("orthographic", "cosine", 256, marks=pytest.mark.slow),
    ],
)
def test_a_floor_by_a_wall_has_the_closed_form(kind: str, weighting: str, rays: int) -> None:
    seen, distance = wall_and_floor(kind)
    truth = layered_occlusion(seen, 1.0, rays, weighting=weighting)
    far = distance > 0.05  # three pixels; nearer, the wall's foot is between pixel centres
    variant = [1.0 - hidden_by_wall(min(c, 1.0), weighting, "none") for c in distance[far]]
    off = truth.mean[far] - np.array(variant)
    # Half the pixels' noise is their neighbours': measured, the mean is off by 2e-4 at most.
    assert abs(float(off.mean())) < 6e-4
    assert float(np.sqrt(np.mean(off**2))) < 1.2 * float(np.sqrt(np.mean(truth.error[far] ** 2)))


# ---- the mesh


def box_on_a_floor() -> tuple[Scene, Camera]:
    """A box, its back turned to a stretch of floor that a camera high before it sees."""
    box = trimesh.creation.box((2.0, 1.0, 0.5))
    box.apply_translation((0.0, 0.5, 0.0))
    floor = quads(((-30, 0, -30), (0, 0, 60), (60, 0, 0)))
    eye = Camera.look_at((0, 7, 2), (0, 0.3, -0.6), yfov=0.4, width=120, height=90)
    return with_mesh(floor, box), eye


def test_where_all_is_in_view_the_mesh_and_one_layer_agree(runtime: Runtime) -> None:
    corner = quads(
        ((-4, 0, -4), (0, 0, 8), (8, 0, 0)), ((-4, 0, -4), (8, 0, 0), (0, 8, 0)), ((-4, 0, -4), (0, 8, 0), (0, 0, 8))
    )
    eye = Camera.look_at((2, 2.5, 2), (-3.6, 0.3, -3.6), yfov=0.9, width=120, height=90)
    seen = gbuffer(corner, eye, runtime=runtime)
    mesh = ambient_occlusion(corner, eye, 0.3, 64, gbuffer=seen).mean
    layer = layered_occlusion(seen, 0.3, 64).mean
    away = np.sort(eye.unproject(np.asarray(seen.depth)) + np.array((4, 0, 4)), axis=-1)[..., 1]
    far = away > 0.08  # 4 pixels from a crease, which lies between pixel centres
    far[:15], far[-15:], far[:, :15], far[:, -15:] = False, False, False, False  # 0.3 units
    assert ((mesh < 0.95) & far).sum() > 200
    # The same rays, of which few find the gap: a step of A is 1/64. Measured: .016.
    off = np.abs(layer - mesh)[far]
    assert np.quantile(off, [0.5, 0.99]).tolist() <= [1e-6, 0.03]


def test_what_is_behind_a_box_is_absent_with_one_layer_and_present_with_two(runtime: Runtime) -> None:
    scene, eye = box_on_a_floor()
    one = gbuffer(scene, eye, runtime=runtime)
    mesh = ambient_occlusion(scene, eye, 0.8, 64, gbuffer=one).mean
    point = eye.unproject(np.asarray(one.depth))
    behind = (
        (np.abs(point[..., 1]) < 1e-3) & (np.abs(point[..., 0]) < 0.7) & (point[..., 2] < -0.3) & (point[..., 2] > -0.9)
    )
    assert behind.sum() > 200
    assert mesh[behind].mean() < 0.9  # by the box's back
    two = gbuffer(scene, eye, layers=2, runtime=runtime)
    layers = [layered_occlusion(seen, 0.8, 64).mean for seen in (one, two)]
    assert layers[0][behind].mean() > 0.95  # its top's rear edge is all that is left
    # The back is in the second layer whole.
    np.testing.assert_allclose(layers[1][behind], mesh[behind], rtol=0, atol=0.02)


def test_overscan_holds_what_is_beside_the_image(runtime: Runtime) -> None:
    scene, eye = box_on_a_floor()
    near = replace(eye, projection=eye.projection * [[2.2], [2.2], [1], [1]])  # cuts the box's ends
    wide = gbuffer(scene, near, layers=2, overscan=0.6, runtime=runtime)
    narrow = gbuffer(scene, near, layers=2, runtime=runtime)
    mesh = ambient_occlusion(scene, near, 0.8, 64, gbuffer=narrow).mean
    errors = [metrics.rmse(layered_occlusion(seen, 0.8, 64).mean, mesh) for seen in (narrow, wide)]
    assert errors[1] < 0.3 * errors[0]


def test_a_scene_far_from_the_origin_is_as_one_at_the_origin() -> None:
    means = []
    for shift in (0.0, 1e6):
        seen_by = camera("perspective", shift=shift)
        floor, wall = (Plane(np.add(p, shift), n) for p, n in (((0, -0.3, 0), (0, 1, 0)), ((0, 0, -1), (0, 0, 1))))
        means.append(layered_occlusion(trace(seen_by, [floor, wall]), 1.0, 128).mean)
    # The camera itself is rounded to 1e-10 there, and depth to float32 after that.
    assert metrics.rmse(*means) < 1e-3


# ---- joins


def covered() -> GBuffer:
    """Return a plane at depth 5 whose right half a nearer one at depth 2 covers; two layers."""
    front, back = np.full((3, 6), 5.0), np.full((3, 6), np.inf)
    front[:, 3:], back[:, 3:] = 2.0, 5.0
    return GBuffer(camera=camera(size=(3, 6)), depth=np.stack([front, back]).astype(np.float32))


@pytest.mark.parametrize(("joins", "triangles"), [("surface", 28), ("layer", 24), ("always", 28)])
def test_a_surface_goes_on_in_another_layer(joins: str, triangles: int) -> None:
    # Of 2 x 2 pixels two triangles: 10 squares of the far plane, 4 of the near one; without what
    # joins the far plane's halves 8; with jumps bridged 10 of the first layer, 4 of the second.
    held = layer_mesh(covered(), joins)
    assert held is not None
    assert len(held.triangles) == triangles


def test_a_jump_is_cut_unless_always_joined() -> None:
    # A sheet hovers over a floor, farther than rays go: nothing is hidden but by bridges.
    eye = Camera.look_at((0, 9, 0.1), (0, 0, 0), yfov=0.4, width=40, height=30)
    floor, sheet = Plane((0, 0, 0), (0, 1, 0)), Plane((0, 1, 0), (0, 1, 0), ((1, 0, 0), 0.2))
    seen = trace(eye, [floor, sheet])
    for joins in ("surface", "layer"):
        np.testing.assert_array_equal(layered_occlusion(seen, 0.8, 64, joins=joins).mean, 1.0)
    assert layered_occlusion(seen, 0.8, 64, joins="always").mean.min() < 0.6


def test_a_wall_meets_a_floor_that_goes_on_behind_it() -> None:
    eye = camera("perspective", (45, 60))
    floor, wall = Plane((0, -0.3, 0), (0, 1, 0)), Plane((0, 0, -0.2), (0, 0, 1))
    alone = trace(eye, [floor, wall])
    front, through = np.asarray(alone.depth), np.asarray(trace(eye, [floor]).depth)
    behind = np.where(through > front * (1.0 + 1e-5), through, np.inf)
    both = replace(alone, depth=np.stack([front, behind]).astype(np.float32))
    # No ray that starts before the wall passes its foot, but for the image's rim.
    a, b = (layered_occlusion(seen, 0.3, 128).mean[5:-5, 5:-5] for seen in (alone, both))
    np.testing.assert_allclose(a, b, rtol=0, atol=0.02)
    assert a.min() < 0.7


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_valley_along_either_diagonal_is_not_filled(mirrored: bool) -> None:
    size = 41
    eye = Camera.orthographic((0, 0, 9), (0, 0, 0), view_height=size, width=size, height=size)
    row, column = np.indices((size, size))
    depth = 90.0 - 0.5 * np.abs(row - column)
    normal = np.zeros((size, size, 3))
    normal[..., 2] = 1.0
    if mirrored:
        depth = depth[:, ::-1]
    seen = GBuffer(camera=eye, depth=depth.astype(np.float32), normal=normal.astype(np.float32))
    a = layered_occlusion(seen, 3.0, 256).mean
    bottom = a[depth == 90.0][5:-5]
    # From the bottom both slopes rise at atan(0.5 sqrt 2): each hides (1 - cos) / 2 of A.
    slope = math.atan(0.5 * math.sqrt(2.0))
    np.testing.assert_allclose(bottom.mean(), math.cos(slope), rtol=0, atol=0.004)


@pytest.mark.parametrize("depth", [[[np.inf] * 4] * 3, [[1.0, np.inf, 1.0, np.inf]] * 3])
def test_where_nothing_is_joined_all_is_open(depth: list[list[float]]) -> None:
    seen = GBuffer(camera=camera(size=(3, 4)), depth=np.array(depth, np.float32))
    truth = layered_occlusion(seen, 1.0, 64)
    np.testing.assert_array_equal(truth.mean, np.ones((3, 4), np.float32))
    np.testing.assert_array_equal(truth.error, np.zeros((3, 4), np.float32))


@pytest.mark.parametrize("joins", JOINS)
@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize(
    "shape", [(1, 1, 1), (2, 1, 9), (2, 9, 1), (6, 4, 5), pytest.param((16, 4, 5), marks=pytest.mark.slow)]
)
def test_whatever_the_layers_hold_the_result_is_in_range(
    joins: str, kind: str, shape: tuple[int, int, int], rng: np.random.Generator
) -> None:
    # Nothing is smooth.
    depth = rng.choice(np.array([1e-30, 1.0, 1.5, 1e30, 3e38, np.inf], np.float32), shape)
    depth.sort(axis=0)
    seen = GBuffer(camera=camera(kind, shape[1:]), depth=depth)
    truth = layered_occlusion(seen, 1.0, 16, joins=joins)
    for values in (truth.mean, truth.error):
        assert values.min() >= 0.0
        assert values.max() <= 1.0


# ---- kept


def test_whatever_changes_the_rays_makes_another_floor() -> None:
    seen = covered()
    depth = np.asarray(seen.depth)
    up = np.zeros((3, 6, 3), np.float32)
    up[..., 1] = 1.0
    calls: list[tuple[GBuffer, float, int, dict[str, Any]]] = [
        (seen, 1.0, 16, {}),
        (replace(seen, depth=depth[0]), 1.0, 16, {}),
        (replace(seen, depth=depth * np.float32(1.5)), 1.0, 16, {}),
        (replace(seen, normal=up), 1.0, 16, {}),
        (replace(seen, camera=camera("orthographic", (3, 6))), 1.0, 16, {}),
        (replace(seen, camera=camera(size=(1, 6))), 1.0, 16, {}),
        (seen, 2.0, 16, {}),
        (seen, 1.0, 16, {"joins": "layer"}),
        (seen, 1.0, 16, {"attenuation": "linear"}),
    ]
    keys = [layered_occlusion(*call[:-1], **call[-1]).key for call in calls]
    assert len(set(keys)) == len(keys)


# ---- bad input


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"gbuffer": "depth.exr"}, TypeError, "gbuffer is str: expected an ssgi_cl.GBuffer"),
        ({"radius": -1.0}, ValueError, r"radius is -1\.0: expected a number > 0 \(scene units\)"),
        ({"rays": 0}, ValueError, r"rays is 0: expected an integer >= 1"),
        ({"joins": "never"}, ValueError, r"joins is 'never': expected one of 'surface'"),
        ({"weighting": "cos"}, ValueError, r"weighting is 'cos': expected one of 'cosine'"),
        ({"attenuation": "cubic"}, ValueError, r"attenuation is 'cubic': expected one of"),
    ],
)
def test_bad_argument_is_named_and_nothing_is_kept(
    folder: Path, arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        layered_occlusion(**{"gbuffer": covered(), "radius": 1.0, **arguments})
    assert not folder.exists()
