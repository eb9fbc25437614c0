"""Hashes of what determines a truth."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.lights import Environment, PointLight, SpotLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.truth.digests import camera_description, digest, light_description, scene_digest

from .estimates import view


def triangle(**changes: Any) -> Scene:
    arrays: dict[str, Any] = {
        "positions": np.eye(3, dtype=np.float32),
        "normals": np.ones((3, 3), np.float32),
        "uvs": np.zeros((3, 2), np.float32),
        "colors": np.ones((3, 3), np.float32),
        "triangles": np.array([[0, 1, 2]], np.int32),
        "material_ids": np.zeros(1, np.int32),
        "textures": (np.zeros((2, 2, 4), np.uint8),),
    }
    return Scene(**{**arrays, **changes})


SCENE_CHANGES: tuple[dict[str, Any], ...] = (
    {"origin": np.array((1.0, 0.0, 0.0))},
    {"positions": np.nextafter(np.eye(3, dtype=np.float32), np.float32(2.0))},
    {"normals": -np.ones((3, 3), np.float32)},
    {"uvs": np.ones((3, 2), np.float32)},
    {"colors": np.zeros((3, 3), np.float32)},
    {"triangles": np.array([[1, 2, 0]], np.int32)},
    {"materials": (Material(), Material())},
    {"materials": (Material(gloss=2.0),)},
    {"materials": (Material(texture=0),)},
    {"textures": (np.ones((2, 2, 4), np.uint8),)},
    {"textures": (np.zeros((4, 1, 4), np.uint8),)},
    {"textures": ()},
)


def test_scene_digest_tells_every_change_apart() -> None:
    found = [scene_digest(triangle(**change)) for change in ({}, *SCENE_CHANGES)]
    assert len(set(found)) == len(found)
    assert scene_digest(triangle()) == found[0]


def test_camera_and_light_descriptions_tell_changes_apart_and_fit_json() -> None:
    cameras = [view(), replace(view(), width=8), replace(view(), view=np.eye(4))]
    sky = np.ones((8, 16, 3))
    lights = [
        PointLight((0, 1, 0), 1.0),
        PointLight((0, 1, 0), 2.0),
        SpotLight((0, 1, 0), (0, -1, 0), 0.5, 1.0),
        SpotLight((0, 1, 0), (0, -1, 0), 0.6, 1.0),
        Environment(1.0),
        Environment(sky),
        Environment(2.0 * sky),
    ]
    texts = [json.dumps(camera_description(camera)) for camera in cameras]
    texts += [json.dumps(light_description(light)) for light in lights]
    assert len(set(texts)) == len(texts)
    assert max(map(len, texts)) < 2000  # a sky is told by its hash


def test_digest_knows_types_shapes_and_the_division_into_parts() -> None:
    zeros = np.zeros(4, np.float32)
    found = [
        digest(zeros),
        digest(zeros.astype(np.int32)),
        digest(zeros.reshape(2, 2)),
        digest(zeros, zeros),
        digest(np.zeros(8, np.float32)),
        digest("a", "b"),
        digest("ab"),
        digest(["a", "b"]),
        digest(None),
        digest(),
    ]
    assert len(set(found)) == len(found)
    assert digest(zeros[::2]) == digest(np.zeros(2, np.float32))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: scene_digest("room.glb"), "scene is str: expected a Scene"),  # type: ignore[arg-type]
        (lambda: camera_description(None), "camera is None"),  # type: ignore[arg-type]
    ],
)
def test_something_else_than_a_scene_or_camera_is_refused(call: Callable[[], object], message: str) -> None:
    with pytest.raises(TypeError, match=message):
        call()
