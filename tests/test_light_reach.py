"""Lights that are proven to light nothing, against every point and normal that boxes hold."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, PointLight, SpotLight
from ssgi_cl.techniques.shading.light_reach import FEW, RUN, Boxes, reaching

Doubles = NDArray[np.float64]
POINTS = 8
"""Of a box."""


def held(rng: np.random.Generator, count: int) -> tuple[Boxes, Doubles, Doubles]:
    """Return `count` boxes round [count, POINTS, 3] points and their normals, and these."""
    middle = rng.uniform(-2.0, 2.0, (count, 1, 3))
    points = middle + rng.uniform(-0.2, 0.2, (count, POINTS, 3))
    facing = rng.normal(size=(count, 1, 3))
    normals = facing / np.linalg.norm(facing, axis=-1, keepdims=True)
    normals = normals + rng.uniform(-0.2, 0.2, points.shape)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return (
        Boxes(
            points.min(axis=1),
            points.max(axis=1),
            normals.min(axis=1),
            normals.max(axis=1),
            (points * normals).sum(axis=-1).min(axis=1),
        ),
        points,
        normals,
    )


@pytest.mark.parametrize("count", [1, RUN + 1])
def test_no_light_that_lights_a_point_is_left_out(rng: np.random.Generator, count: int) -> None:
    camera = Camera.look_at((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), width=4, height=4)
    turn, shift = camera.view[:3, :3], camera.view[:3, 3]
    punctual_lights = [
        PointLight(p, 1.0, radius=r)
        for p, r in zip(rng.uniform(-2.0, 4.0, (60, 3)), rng.uniform(0.0, 0.5, 60), strict=True)
    ]
    punctual_lights += [
        SpotLight(p, d, 0.4, 1.0, radius=r)
        for p, d, r in zip(
            rng.uniform(-2.0, 4.0, (60, 3)), rng.normal(size=(60, 3)), rng.uniform(0.0, 0.2, 60), strict=True
        )
    ]
    punctual_lights += [DirectionalLight(d, 1.0) for d in rng.normal(size=(60, 3))]
    left_out = 0
    for _ in range(40 if count == 1 else 4):
        boxes, points, normals = held(rng, count)
        assert (len(punctual_lights) * count <= FEW) == (count == 1)
        found = reaching(punctual_lights, boxes, camera)
        for punctual_light, reaches in zip(punctual_lights, found, strict=True):
            if isinstance(punctual_light, DirectionalLight):
                lit = normals @ turn @ -np.asarray(punctual_light.direction) > 1e-4
            else:
                way = turn @ np.asarray(punctual_light.position) + shift - points
                lit = (normals * way).sum(axis=-1) + punctual_light.radius > 1e-4
            if isinstance(punctual_light, SpotLight):
                axis = turn @ np.asarray(punctual_light.direction)
                lit &= way @ -axis > np.cos(punctual_light.cone_angle) * np.linalg.norm(way, axis=-1)
            assert reaches or not lit.any(), punctual_light
        left_out += np.count_nonzero(~found)
    # Some are: of a single box nearly all that turn away.
    assert left_out > (1000 if count == 1 else 0)


def test_a_light_behind_a_slanted_plane_is_left_out_though_its_box_is_large() -> None:
    normal = np.array([1.0, 1.0, 0.0]) / math.sqrt(2.0)
    box = Boxes(
        np.array([[-1.0, -1.0, -6.0]]), np.array([[1.0, 1.0, -5.0]]), normal[None], normal[None], np.array([0.0])
    )
    camera = Camera(view=np.eye(4), projection=np.diag([1.0, 1.0, -1.0, 1.0]), width=4, height=4)
    behind, before = (PointLight(way * normal + (0.0, 0.0, -5.5), 1.0) for way in (-0.1, 0.1))
    sun = DirectionalLight(-normal, 1.0)
    assert reaching([behind, before, sun], box, camera).tolist() == [False, True, True]
    assert reaching([behind, before], box, camera).tolist() == [False, True]
