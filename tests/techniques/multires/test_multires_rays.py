"""Light that the triangles of a scene block: the gather's rays, held to float64."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.occupancy.scene_rays import LIFT

from ...frame.scenes import halves, scene_of

Doubles = NDArray[np.float64]

FLOOR = np.array([(-6, 0, -6), (-6, 0, 6), (6, 0, 6), (6, 0, -6)], np.float64)


def slats(rng: np.random.Generator, count: int, width: float) -> Doubles:
    """Return corners [count, 3, 3] of thin triangles above the floor."""
    middle = rng.uniform((-1.0, 0.3, -1.0), (1.0, 1.2, 1.0), (count, 3))
    along, across = rng.uniform(-1.0, 1.0, (2, count, 3))
    across *= width / np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(np.stack([middle - along, middle + along, middle + across], axis=1))


def made(blockers: Doubles, shift: Doubles | float = 0.0) -> Scene:
    corners = np.concatenate([FLOOR + shift, blockers.reshape(-1, 3) + shift])
    faces = [*halves([(0, 1, 2, 3)]), *(4 + np.arange(3 * len(blockers)).reshape(-1, 3)).tolist()]
    return scene_of(corners, faces, Material(albedo=(0.5, 0.5, 0.5)))


def hidden(blockers: Doubles, start: Doubles, end: Doubles) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether a triangle is between points [n, 3] and one point, and whether that is near an edge of one."""
    a, b = blockers[:, 1] - blockers[:, 0], blockers[:, 2] - blockers[:, 0]
    way = (end - start)[:, None]
    p = np.cross(way, b)
    det = (p * a).sum(axis=2)
    s = start[:, None] - blockers[:, 0]
    q = np.cross(s, a)
    u, v, t = (s * p).sum(axis=2) / det, (way * q).sum(axis=2) / det, (b * q).sum(axis=2) / det
    least = np.stack([u, v, 1.0 - u - v, t, 1.0 - t]).min(axis=0)
    # Pixels and corners are of float32.
    return (least > 0.0).any(axis=1), (np.abs(least) < 1e-3).any(axis=1)


@pytest.mark.parametrize("eye", [(0.3, 4.0, 0.1), (900.3, 4.0, 0.1)], ids=["near", "far from the origin"])
@pytest.mark.parametrize("width", [0.5, 0.02])
def test_a_light_is_hidden_where_a_triangle_is_in_the_way(
    variant_runtime: Runtime, rng: np.random.Generator, width: float, eye: tuple[float, float, float]
) -> None:
    # The narrow ones are thinner than the cells of any grid.
    runtime, shift = variant_runtime, np.array([eye[0] - 0.3, 0.0, 0.0])
    blockers = slats(rng, 40, width)
    scene = made(blockers, shift)
    camera = gi.Camera.look_at(eye, shift, (0.0, 0.0, -1.0), yfov=0.9, width=60, height=40)
    floor = gi.rasterize.gbuffer(made(blockers[:0], shift), camera, runtime=runtime)
    place = np.array([0.2, 1.8, -0.3])
    light = Vpls((place + shift)[None], np.array([[0.0, -1.0, 0.0]]), np.ones((1, 3)), np.array([1e-3]))
    params = MultiresSplatParams(vpls=1, visibility=True, grid=32, coarsest=1, light_error=0.0)
    technique = MultiresSplat(runtime, floor.size, params)
    with runtime.frame():
        device = on_device(floor, runtime)
        free = technique.run(device, light, blockers=made(blockers[:0], shift)).download()[0]
        found = technique.run(device, light, blockers=scene).download()[0]
    assert free.min() > 0.0
    points = camera.unproject(np.asarray(floor.depth, np.float64).reshape(floor.size)) - shift
    lift = np.array([0.0, LIFT * np.linalg.norm(np.ptp(scene.bounds, axis=0)), 0.0])
    blocked, near = (a.reshape(floor.size) for a in hidden(blockers, points.reshape(-1, 3) + lift, place - lift))
    sure = ~near if shift[0] == 0.0 else np.ones_like(near)
    share = found / free
    assert np.isin(share, (0.0, 1.0)).all()
    assert 0.02 < blocked.mean() < 0.95
    # 900 units from the origin, float32 corners of triangles are 6e-5 off: a few pixels at edges.
    wrong = (share == 0.0)[sure] != blocked[sure]
    assert wrong.mean() < (1e-9 if shift[0] == 0.0 else 0.01)


def test_blockers_need_visibility(runtime: Runtime, rng: np.random.Generator) -> None:
    scene = made(slats(rng, 2, 0.1))
    camera = gi.Camera.look_at((0.3, 4.0, 0.1), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), yfov=0.9, width=8, height=6)
    floor = gi.rasterize.gbuffer(scene, camera, runtime=runtime)
    light = Vpls(np.array([[0.0, 1.0, 0.0]]), np.array([[0.0, -1.0, 0.0]]), np.ones((1, 3)), np.array([1e-3]))
    technique = MultiresSplat(runtime, floor.size, MultiresSplatParams(vpls=1))
    with runtime.frame(), pytest.raises(ValueError, match="blockers is a Scene: expected None without visibility"):
        technique.run(on_device(floor, runtime), light, blockers=scene)
