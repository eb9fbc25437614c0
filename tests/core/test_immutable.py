"""Objects cached by identity: their arrays are read-only, in copies too."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.immutable import frozen
from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime

from ..rasterize.meshes import scene_of

CORNERS = np.float32([[-1, -1, -2], [1, -1, -2], [0, 1, -2]])


def triangle(positions: Any = CORNERS, texture: Any = None) -> Scene:
    """Return a triangle 2 units in front of the world's origin."""
    return scene_of(positions, textures=[np.zeros((2, 2, 4), np.uint8) if texture is None else texture])


def camera() -> Camera:
    return Camera.look_at((0, 0, 0), (0, 0, -1), width=16, height=12)


def rsm() -> ReflectiveShadowMap:
    plane, vectors = np.ones((12, 16), np.float32), np.ones((12, 16, 3), np.float32)
    return ReflectiveShadowMap(
        light=SpotLight((0, 0, 0), (0, 0, -1), 0.5, 1.0),
        camera=camera(),
        depth=plane,
        position=vectors,
        normal=vectors,
        flux=vectors,
        specular_flux=vectors,
        gloss=plane,
    )


OBJECTS: dict[str, Callable[[], Any]] = {
    "scene": triangle,
    "camera": camera,
    "rsm": rsm,
    "spot": lambda: SpotLight((0, 1, 0), (0, -1, 0), 0.5, 1.0),
    "point": lambda: PointLight((0, 1, 0), 1.0),
    "sun": lambda: DirectionalLight((0, -1, 0), 1.0),
    "sky": lambda: Environment(np.ones((2, 4, 3))),
}
COPIES: dict[str, Callable[[Any], Any]] = {
    "itself": lambda made: made,
    "pickle": lambda made: pickle.loads(pickle.dumps(made)),
    "pickle protocol 5": lambda made: pickle.loads(pickle.dumps(made, protocol=5)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "replace": dataclasses.replace,
}


def arrays_of(made: Any) -> Iterator[tuple[str, Any]]:
    for field in dataclasses.fields(made):
        value = getattr(made, field.name)
        values = value if isinstance(value, tuple) else (value,)
        yield from ((field.name, one) for one in values if isinstance(one, np.ndarray))
    if isinstance(made, Scene):
        yield "bounds", made.bounds


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("kind", OBJECTS)
def test_arrays_are_read_only_in_every_copy(kind: str, how: str) -> None:
    first = OBJECTS[kind]()
    before = list(arrays_of(first))  # a scene keeps its bounds from here on
    assert before
    second = COPIES[how](first)
    for (name, old), (_, new) in zip(before, arrays_of(second), strict=True):
        np.testing.assert_array_equal(new, old)
        holder = new
        while isinstance(holder, np.ndarray):
            assert not holder.flags.writeable, name
            holder = holder.base


@pytest.mark.parametrize("view", [lambda a: a, lambda a: a[:], lambda a: a.view()])
def test_a_scene_does_not_share_memory_that_its_maker_can_write_to(view: Callable[[Any], Any]) -> None:
    positions, texture = CORNERS.copy(), np.zeros((2, 2, 4), np.uint8)
    given = view(positions)
    given.flags.writeable = positions is given  # a read-only view of a writable array
    made = triangle(given, view(texture))
    positions *= 2.0
    texture[...] = 9
    np.testing.assert_array_equal(made.positions, CORNERS)
    assert not made.textures[0].any()


def test_what_nobody_can_write_to_is_not_copied() -> None:
    made = triangle()
    assert dataclasses.replace(made).positions is made.positions
    constant = np.frombuffer(CORNERS.tobytes(), np.float32).reshape(3, 3)
    assert triangle(constant).positions is constant
    fresh = np.asarray(CORNERS, np.float64).astype(np.float32)
    assert frozen(fresh, CORNERS.tolist()) is fresh


def test_a_changed_scene_is_another_picture(runtime: Runtime) -> None:
    made = triangle()
    depth = gi.rasterize.gbuffer(made, camera(), runtime=runtime).depth
    with pytest.raises(ValueError, match="read-only"):
        made.positions[:] *= 0.5
    nearer = dataclasses.replace(made, positions=made.positions * 0.5)
    other = gi.rasterize.gbuffer(nearer, camera(), runtime=runtime).depth
    seen = np.isfinite(depth)
    assert seen.any()
    np.testing.assert_allclose(np.asarray(other)[seen], np.asarray(depth)[seen] / 2, rtol=1e-6)
