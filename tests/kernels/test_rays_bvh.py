"""kernels/rays/bvh.clh: rays against triangles, held to all triangles one by one in float64."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from ssgi_cl.core.bvh import bvh_of
from ssgi_cl.core.wide_bvh import wide_bvh_of
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.bvh_split import bvh_split

from .expression import run_expressions

Floats = NDArray[np.float32]
RAY = "((RaysRay){x, y, z, wx, wy, wz})"
BLOCKED = f"v_select(v_splat(0.0f), v_splat(1.0f), rays_blocked(nodes, triangles, {RAY}, v_gt(wanted, v_splat(0.0f))))"


def blocked(
    runtime: Runtime,
    corners: Floats,
    culled: NDArray[np.bool_],
    origin: Floats,
    way: Floats,
    wanted: Floats | None = None,
) -> NDArray[np.bool_]:
    """Whether each ray meets a triangle."""
    bvh = bvh_of(corners.transpose(1, 2, 0), culled, partial(bvh_split, runtime))
    names = ("x", "y", "z", "wx", "wy", "wz")
    rays = dict(zip(names, np.concatenate([origin, way], axis=1).T.astype(np.float32), strict=True))
    tables = {"nodes": bvh.nodes.ravel(), "triangles": bvh.triangles.ravel()}
    result = run_expressions(
        runtime, "rays/bvh.clh", {"blocked": BLOCKED}, tables=tables,
        wanted=np.ones(len(origin), np.float32) if wanted is None else wanted, **rays,
    )  # fmt: skip
    return result["blocked"] > 0.5


def truth(
    corners: Floats, culled: NDArray[np.bool_], origin: Floats, way: Floats
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether a ray meets a triangle, and whether it passes so near an edge or an end that rounding decides."""
    c, o, w = (a.astype(np.float64) for a in (corners, origin, way))
    a, b = c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]
    p = np.cross(w[:, None], b)
    det = (p * a).sum(axis=2)
    s = o[:, None] - c[:, 0]
    q = np.cross(s, a)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v, t = (s * p).sum(axis=2) / det, (w[:, None] * q).sum(axis=2) / det, (b * q).sum(axis=2) / det
    inside = np.stack([u, v, 1.0 - u - v, t, 1.0 - t])
    side = (det < 0.0) | ~culled
    least = np.where(np.isfinite(inside).all(axis=0), inside.min(axis=0), -1.0)
    return ((least > 0.0) & side).any(axis=1), ((np.abs(least) < 2e-4) & side).any(axis=1)


@pytest.mark.parametrize("count", [1, 5, 64, 700])
@pytest.mark.parametrize("backs", ["there", "not there", "some there"])
def test_rays_are_blocked_where_any_triangle_is_in_the_way(
    variant_runtime: Runtime, count: int, backs: str, rng: np.random.Generator
) -> None:
    size = 0.6 * count ** (-1.0 / 3.0)
    corners = (rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0.0, size, (count, 3, 3))).astype(np.float32)
    culled = {"there": np.zeros(count, bool), "not there": np.ones(count, bool)}.get(backs, rng.random(count) < 0.5)
    origin = rng.uniform(-1.5, 1.5, (4000, 3)).astype(np.float32)
    way = (rng.uniform(-1.5, 1.5, (4000, 3)) - origin).astype(np.float32)
    way[:300, rng.integers(0, 3)] = 0.0  # along a plane of the axes
    right, unsure = truth(corners, culled, origin, way)
    found = blocked(variant_runtime, corners, culled, origin, way)
    assert np.count_nonzero(unsure) < 0.1 * len(origin)
    assert 0 < np.count_nonzero(right) < len(right)
    np.testing.assert_array_equal(found[~unsure], right[~unsure])


@pytest.mark.parametrize("count", [1, 64, 700])
def test_the_first_triangle_that_a_ray_meets_is_found(
    variant_runtime: Runtime, count: int, rng: np.random.Generator
) -> None:
    corners = (rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0.0, 0.3, (count, 3, 3))).astype(np.float32)
    origin = rng.uniform(-1.5, 1.5, (2000, 3)).astype(np.float32)
    way = (rng.uniform(-1.5, 1.5, (2000, 3)) - origin).astype(np.float32)
    bvh = bvh_of(corners.transpose(1, 2, 0), np.zeros(count, bool), partial(bvh_split, variant_runtime))
    call = f"rays_closest(nodes, triangles, {RAY}, v_gt(x, v_splat(-9.0f)))"
    names = ("x", "y", "z", "wx", "wy", "wz")
    found = run_expressions(
        variant_runtime, "rays/bvh.clh", {"where": f"{call}.where", "place": f"v_to_float({call}.triangle)"},
        tables={"nodes": bvh.nodes.ravel(), "triangles": bvh.triangles.ravel()},
        **dict(zip(names, np.concatenate([origin, way], axis=1).T, strict=True)),
    )  # fmt: skip
    c, o, w = (a.astype(np.float64) for a in (corners, origin, way))
    sides = np.stack([c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]], axis=-1)
    system = np.concatenate(
        [np.broadcast_to(sides, (2000, *sides.shape)), -np.repeat(w[:, None, :, None], count, 1)], -1
    )
    u, v, t = np.moveaxis(np.linalg.solve(system, (o[:, None] - c[:, 0])[..., None])[..., 0], -1, 0)
    least = np.stack([u, v, 1.0 - u - v, t, 1.0 - t]).min(axis=0)
    unsure = (np.abs(least) < 1e-3).any(axis=1)
    t = np.where(least > 0.0, t, np.inf)
    first, met = t.min(axis=1), np.isfinite(t).any(axis=1)
    assert np.count_nonzero(met & ~unsure) > 0
    assert np.count_nonzero(~met & ~unsure) > 10
    np.testing.assert_array_equal((found["place"] >= 0.0)[~unsure], met[~unsure])
    sure = met & ~unsure
    np.testing.assert_allclose(found["where"][sure], first[sure], rtol=2e-4, atol=2e-5)
    number = bvh.triangles.view(np.int32)[found["place"][sure].astype(int), 10]
    apart = np.sort(np.concatenate([t, np.full((2000, 1), np.inf)], axis=1), axis=1)[sure]
    clear = apart[:, 1] > apart[:, 0] + 1e-3
    np.testing.assert_array_equal(number[clear], t.argmin(axis=1)[sure][clear])


def test_no_light_comes_between_triangles_that_share_an_edge(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    # A bumpy sheet of 40 x 40 squares; rays go straight through its edges and corners.
    place = np.linspace(-1.0, 1.0, 41)
    grid = np.stack([*np.meshgrid(place, place), rng.normal(0.0, 0.01, (41, 41))], axis=2).astype(np.float32)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    corners = np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)
    through = (0.5 * (grid[5:-5, 5:-6] + grid[5:-5, 6:-5])).reshape(-1, 3)
    through = np.concatenate([through, grid[5:-5, 5:-5].reshape(-1, 3)])
    origin = np.array([0.1, 0.2, 3.0], np.float32) + 0 * through
    found = blocked(variant_runtime, corners, np.zeros(len(corners), bool), origin, 2.0 * (through - origin))
    assert found.all()


def test_rays_into_the_edges_of_a_room_leave_none_and_depend_on_no_neighbour(
    variant_runtime: Runtime, rng: np.random.Generator
) -> None:
    # Walls at right angles, whose boxes are flat: rounding alone says whether a ray meets that of either.
    corners = trimesh.creation.box(extents=(0.9, 1.1, 1.3)).triangles.astype(np.float32) + np.float32(0.3)
    corners = np.concatenate([corners, corners * 0.2 + 0.2])  # and a box in it
    wall, side = rng.integers(12, size=4000), rng.integers(3, size=4000)
    part = rng.random((4000, 1))
    to = corners[wall, side] * (1.0 - part) + corners[wall, (side + 1) % 3] * part
    origin = (0.3 + rng.uniform(-0.4, 0.4, (4000, 3))).astype(np.float32)
    way = 2.0 * (to - origin)
    found = blocked(variant_runtime, corners, np.zeros(24, bool), origin, way)
    assert found.all()
    # A wall less: rays leave, beside others that do not.
    order = rng.permutation(4000)
    fewer, backs = corners[2:], np.zeros(22, bool)
    found, other = (blocked(variant_runtime, fewer, backs, origin[at], way[at]) for at in (np.arange(4000), order))
    assert not found.all()
    np.testing.assert_array_equal(found[order], other)


def test_nothing_blocks_an_empty_scene_and_unwanted_rays_are_not_cast(runtime: Runtime) -> None:
    origin, way = np.zeros((20, 3), np.float32), np.ones((20, 3), np.float32)
    assert not blocked(runtime, np.zeros((0, 3, 3), np.float32), np.zeros(0, bool), origin, way).any()
    wall = np.array([[[0.5, -9, -9], [0.5, 9, -9], [0.5, 0, 9]]], np.float32)
    wanted = (np.arange(20) % 2).astype(np.float32)
    np.testing.assert_array_equal(blocked(runtime, wall, np.zeros(1, bool), origin, way, wanted), wanted > 0.0)


@pytest.mark.parametrize("scene", ["small triangles", "boxes along the axes", "nothing"])
def test_rays_one_by_one_meet_what_rays_together_meet(
    variant_runtime: Runtime, scene: str, rng: np.random.Generator
) -> None:
    if scene == "small triangles":
        corners = rng.uniform(-1, 1, (5000, 1, 3)) + rng.normal(0.0, 0.05, (5000, 3, 3))
    else:
        # Sides that share edges, many in planes of the axes and of each other.
        low = rng.integers(-8, 8, (400, 1, 1, 3)) / 8
        side = rng.integers(1, 4, (400, 1, 1, 3)) / 8
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])[[[0, 1, 2], [0, 2, 3]]]
        faces = [np.insert(square, axis, at, axis=-1) for axis in range(3) for at in (0, 1)]
        corners = (low + side * np.concatenate(faces)).reshape(-1, 3, 3)
        corners = corners[: 0 if scene == "nothing" else None]
    culled = rng.random(len(corners)) < 0.3
    bvh = bvh_of(corners.astype(np.float32).transpose(1, 2, 0), culled, partial(bvh_split, variant_runtime))
    origin = rng.uniform(-1.5, 1.5, (6000, 3)).astype(np.float32)
    way = (rng.uniform(-1.5, 1.5, (6000, 3)) - origin).astype(np.float32)
    way[:600, rng.integers(0, 3)] = 0.0
    way[600:1200] = np.round(8 * way[600:1200]) / 8
    origin[600:1200] = np.round(8 * origin[600:1200]) / 8
    wanted = (rng.random(len(origin)) < 0.7).astype(np.float32)
    lanes = variant_runtime.variant.lanes
    wide = wide_bvh_of(bvh, lanes) if lanes > 1 else None
    tables = {
        "nodes": bvh.nodes.ravel(),
        "triangles": bvh.triangles.ravel(),
        "wide": (bvh.nodes if wide is None else wide.nodes).ravel(),
        "blocks": (bvh.nodes if wide is None else wide.blocks).ravel(),
    }
    together = f"rays_closest(nodes, triangles, {RAY}, v_gt(wanted, v_splat(0.0f)))"
    one = f"rays_first(wide, blocks, triangles, {RAY}, v_gt(wanted, v_splat(0.0f)))"
    found = run_expressions(
        variant_runtime, "rays/first.clh",
        {
            "where": f"{together}.where", "triangle": f"v_to_float({together}.triangle)",
            "where_one": f"{one}.where", "triangle_one": f"v_to_float({one}.triangle)",
        },
        macros={"RAYS_ONE": 1}, tables=tables, wanted=wanted,
        **dict(zip(("x", "y", "z", "wx", "wy", "wz"), np.concatenate([origin, way], axis=1).T, strict=True)),
    )  # fmt: skip
    np.testing.assert_array_equal(found["where_one"], found["where"])
    np.testing.assert_array_equal(found["triangle_one"], found["triangle"])
    met = np.count_nonzero(found["triangle"] >= 0.0)
    assert met == 0 if scene == "nothing" else 1000 < met < np.count_nonzero(wanted)
