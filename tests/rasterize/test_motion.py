"""Motion that the rasteriser draws: against that of the depth and the cameras in float64, and of turned objects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.motion import MOST_MOTION, camera_motion
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer, moved

from .meshes import made, quad, scene_of

Doubles = NDArray[np.float64]
SIZE = (75, 100)
ROUNDING = 2e-4
"""Pixels: depths are rounded to 2^-24 of them and vertices lie up to 30 units from the eye; a motion of some pixels is
that of both ends. Measured: 3e-5 for all but pixels at silhouettes, where the depth is limited to the triangle's."""
FEW = 2e-3
"""Share of pixels at such silhouettes."""


def camera_of(name: str, kind: str, step: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Camera:
    room = made(name)
    eye, target = np.add(room.eye, step), np.add(room.target, np.multiply(step, 0.5))
    if kind == "orthographic":
        return Camera.orthographic(eye, target, view_height=4.0, width=SIZE[1], height=SIZE[0])
    return Camera.look_at(eye, target, yfov=room.yfov, width=SIZE[1], height=SIZE[0])


def motion(drawn: GBuffer) -> Doubles:
    return np.asarray(drawn.motion, np.float64)


def share_off(found: Doubles, wanted: Doubles, tolerance: float) -> float:
    return float((np.abs(found - wanted).max(axis=-1) > tolerance).mean())


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize("overscan", [0.0, 0.1])
def test_drawn_motion_of_a_still_scene_is_that_of_depth_and_cameras(
    variant_runtime: Runtime, kind: str, overscan: float
) -> None:
    now, before = camera_of("parlour", kind), camera_of("parlour", kind, (0.1, 0.05, -0.04))
    drawn = gbuffer(
        made("parlour").scene, now, previous_camera=before, overscan=overscan, layers=2, runtime=variant_runtime
    )
    depth = np.asarray(drawn.depth)[0]
    wanted = camera_motion(depth, now, before)
    assert np.abs(wanted[..., :2]).max() > 1.0
    assert share_off(motion(drawn)[..., :2], wanted[..., :2], ROUNDING) <= FEW
    assert share_off(motion(drawn)[..., 2:], wanted[..., 2:], 1e-5) <= FEW  # roundings of depths of up to 8


def test_still_scene_before_a_still_camera_has_no_motion_at_all(variant_runtime: Runtime) -> None:
    camera = camera_of("parlour", "perspective")
    drawn = gbuffer(made("parlour").scene, camera, previous_camera=camera, runtime=variant_runtime)
    assert not motion(drawn).any()


def turned_about(point: Any, angle: float) -> Doubles:
    """Return the [4, 4] rotation about the vertical line through a point."""
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.eye(4)
    matrix[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
    matrix[:3, 3] = point - matrix[:3, :3] @ point
    return matrix


def box_before_a_wall() -> tuple[Scene, NDArray[np.bool_]]:
    """Return a scene of a wall and of a slanted quad in front of it, and which vertices are the quad's."""
    wall = quad([(-4, -3, -4), (4, -3, -4), (4, 3, -4), (-4, 3, -4)])
    front = quad([(-1, -1, -2.2), (1, -1, -1.6), (1, 1, -1.6), (-1, 1, -2.2)])
    positions = np.concatenate([wall.positions, front.positions])
    triangles = np.concatenate([wall.triangles, front.triangles + len(wall.positions)])
    scene = scene_of(positions, triangles, origin=np.array([1000.0, 0.0, 0.0]))
    return scene, np.arange(len(positions)) >= len(wall.positions)


@pytest.mark.parametrize("moving_camera", [False, True])
def test_turned_object_has_the_motion_of_its_transform_and_the_wall_that_of_the_camera(
    variant_runtime: Runtime, moving_camera: bool
) -> None:
    before, own = box_before_a_wall()
    turn = turned_about(np.array([1000.0, 0.0, -2.0]), 0.2)
    now = moved(before, turn, vertices=own)
    camera = Camera.look_at((1000, 0, 2), (1000, 0, -2), yfov=0.8, width=SIZE[1], height=SIZE[0])
    shifted = Camera.look_at((1000.2, 0.1, 2.3), (1000, 0, -2), yfov=1.0, width=SIZE[1] * 2, height=SIZE[0] * 2)
    previous = shifted if moving_camera else camera
    drawn = gbuffer(now, camera, previous_camera=previous, previous_scene=before, runtime=variant_runtime)
    depth = np.asarray(drawn.depth)
    front = depth < 5.0
    assert 0.05 < front.mean() < 0.5
    world = camera.unproject(depth)
    back = np.linalg.inv(turn)
    world = np.where(front[..., None], world @ back[:3, :3].T + back[:3, 3], world)
    view = np.append(world, np.ones((*SIZE, 1)), axis=-1) @ previous.view.T
    clip = view @ previous.projection.T
    rows, columns = np.indices(SIZE) + 0.5
    wanted = np.stack(
        [
            (clip[..., 0] / clip[..., 3] + 1) / 2 * SIZE[1] - columns,
            (1 - clip[..., 1] / clip[..., 3]) / 2 * SIZE[0] - rows,
            -view[..., 2] - depth,
        ],
        axis=-1,
    )
    assert np.abs(wanted[front]).max() > 1.0  # pixels: more than any rounding
    assert share_off(motion(drawn), wanted, ROUNDING) == 0.0
    if not moving_camera:
        assert not motion(drawn)[~front].any()


def test_what_was_behind_the_previous_camera_has_the_longest_motion(variant_runtime: Runtime) -> None:
    scene, _ = box_before_a_wall()
    camera = Camera.look_at((1000, 0, 2), (1000, 0, -2), yfov=0.8, width=SIZE[1], height=SIZE[0])
    beyond = Camera.look_at((1000, 0, -6), (1000, 0, -8), yfov=1.0, width=SIZE[1], height=SIZE[0])
    drawn = gbuffer(scene, camera, previous_camera=beyond, runtime=variant_runtime)
    there = np.isfinite(np.asarray(drawn.depth))
    assert (motion(drawn)[there] == (MOST_MOTION, MOST_MOTION, 0.0)).all()
    assert not motion(drawn)[~there].any()


def test_motion_is_drawn_when_asked_for_alone(runtime: Runtime) -> None:
    scene, camera = made("parlour").scene, camera_of("parlour", "perspective")
    plain = gbuffer(scene, camera, runtime=runtime)
    with_motion = gbuffer(scene, camera, previous_scene=scene, runtime=runtime)
    assert plain.motion is None
    assert with_motion.motion is not None
    assert gbuffer(scene, camera, runtime=runtime).motion is None
    for name in ("depth", "normal", "albedo"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(with_motion, name))


def test_scene_moves_there_and_back(rng: np.random.Generator) -> None:
    scene, own = box_before_a_wall()
    scene = replace(scene, normals=rng.normal(size=scene.normals.shape).astype(np.float32))
    matrix = turned_about(np.array([1000.0, 0.0, -2.0]), 0.7)
    there = moved(scene, matrix, vertices=np.flatnonzero(own))
    np.testing.assert_array_equal(there.positions[~own], scene.positions[~own])
    assert np.abs(there.positions[own] - scene.positions[own]).max() > 0.5
    back = moved(there, np.linalg.inv(matrix), vertices=own)
    np.testing.assert_allclose(back.positions, scene.positions, atol=1e-6)  # roundings of float32 near 2
    unit = scene.normals[own] / np.linalg.norm(scene.normals[own], axis=1, keepdims=True)
    np.testing.assert_allclose(back.normals[own], unit, atol=1e-6)
    # Of a stretched plane, normals stay at right angles to it.
    flat = quad([(0, 0, 0), (1, 0, 1), (1, 1, 1), (0, 1, 0)], normals=(-1.0, 0.0, 1.0))
    wide = moved(flat, np.diag([3.0, 1.0, 1.0, 1.0]))
    edge = wide.positions[1] - wide.positions[0]
    np.testing.assert_allclose(wide.normals @ edge, 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"previous_camera": "left"}, TypeError, r"previous_camera is 'left': expected an ssgi_cl.Camera"),
        ({"previous_scene": 3}, TypeError, r"previous_scene is int: expected a Scene"),
        ({"previous_scene": "other"}, ValueError, r"previous_scene has \d+ vertices .*in the same order"),
        ({"previous_scene": "same", "backend": "pyrender"}, ValueError, r"apply only to backend='opencl'"),
    ],
    ids=["camera", "scene", "triangles", "backend"],
)
def test_bad_previous_image_is_refused(
    runtime: Runtime, arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    scene, _ = box_before_a_wall()
    named = {"other": quad([(-4, -3, -4), (4, -3, -4), (4, 3, -4), (-4, 3, -4)]), "same": scene}
    given = {key: named.get(value, value) if key == "previous_scene" else value for key, value in arguments.items()}
    with pytest.raises(error, match=message):
        gbuffer(scene, camera_of("parlour", "perspective"), runtime=runtime, **given)


@pytest.mark.parametrize(
    ("transform", "vertices", "error", "message"),
    [
        (np.zeros((4, 4)), None, ValueError, "expected an invertible affine map"),
        (np.eye(3), None, ValueError, r"transform has shape \(3, 3\)"),
        (np.eye(4), [99], ValueError, "vertices are 99 to 99: expected 0 to 7"),
        (np.eye(4), [0.5], TypeError, "expected 8 bool, or numbers of vertices"),
        (np.eye(4), [True, False], TypeError, "expected 8 bool"),
    ],
    ids=["singular", "shape", "number", "fraction", "bools"],
)
def test_bad_move_is_refused(transform: Any, vertices: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        moved(box_before_a_wall()[0], transform, vertices=vertices)
