"""The space of normals is found in every scene, encoding and orientation, or refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.normal_space import AXES, ENCODED, UnclearSpaceError, detected_space, named_space
from ssgi_cl.rasterize.raster.view import gbuffer as drawn
from ssgi_cl.rasterize.scenes import cornell_box

Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@pytest.fixture(scope="module")
def seen() -> tuple[Any, Any, Camera]:
    """Normals in view space, the depth, and the camera: it looks along an axis, the hardest case."""
    room = cornell_box()
    camera = room.camera(100, 80)
    gbuffer = drawn(room.scene, camera)
    return gbuffer.first("normal") @ camera.view[:3, :3].T, gbuffer.first("depth"), camera


def stored(normal: Any, encoded: bool) -> Any:
    return np.where((normal != 0.0).any(axis=-1, keepdims=True), 0.5 * normal + 0.5, 0.0) if encoded else normal


@pytest.mark.parametrize("encoded", [False, True])
@pytest.mark.parametrize("name", [*AXES, "world"])
def test_each_space_is_found(seen: tuple[Any, Any, Camera], name: str, encoded: bool) -> None:
    normal, depth, camera = seen
    to_view = named_space(name, camera).to_view
    space = detected_space(stored(normal @ to_view, encoded), depth, camera, world=True)
    assert space.name == name + ENCODED * encoded
    assert space.residual < 0.1  # flat walls: rounding alone
    np.testing.assert_allclose(space.to_view, to_view)


@pytest.mark.parametrize("world", [np.eye(3), Z_UP, np.diag([1.0, 1.0, -1.0])], ids=["y up", "z up", "left-handed"])
def test_axes_of_an_unknown_world_are_found(seen: tuple[Any, Any, Camera], world: Any) -> None:
    normal, depth, camera = seen
    of_world = normal @ camera.view[:3, :3] @ world.T
    space = detected_space(of_world, depth, camera, world=False)
    assert (space.name, space.found) == ("world", True)
    np.testing.assert_allclose(of_world @ space.to_view.T, normal, atol=1e-3)  # float32 depths of flat walls


def test_noise_of_a_percent_and_any_length_change_nothing(
    seen: tuple[Any, Any, Camera], rng: np.random.Generator
) -> None:
    normal, depth, camera = seen
    noisy = depth * (1.0 + 0.01 * rng.standard_normal(depth.shape))
    space = detected_space(3.0 * normal * [1.0, -1.0, -1.0], noisy, camera, world=True)
    assert space.name == "opencv"


def test_normals_that_face_away_are_of_the_same_space(seen: tuple[Any, Any, Camera], rng: np.random.Generator) -> None:
    normal, depth, camera = seen
    turned = normal * rng.choice([-1.0, 1.0], p=[0.2, 0.8], size=(*depth.shape, 1))
    assert detected_space(turned, depth, camera, world=True).name == "camera"


def test_normals_of_another_picture_are_refused(seen: tuple[Any, Any, Camera], rng: np.random.Generator) -> None:
    _, depth, camera = seen
    other = rng.standard_normal((*depth.shape, 3))
    with pytest.raises(UnclearSpaceError, match=r"is \d+\.\d degrees and '.*' is \d+\.\d degrees off .* normal_space"):
        detected_space(other, depth, camera, world=True)


def test_too_few_surfaces_are_refused(seen: tuple[Any, Any, Camera]) -> None:
    normal, depth, camera = seen
    with pytest.raises(UnclearSpaceError, match="has 0 pixels on smooth surfaces: expected 50"):
        detected_space(normal, np.full_like(depth, np.inf), camera, world=True)


def test_an_unknown_name_lists_the_known(seen: tuple[Any, Any, Camera]) -> None:
    with pytest.raises(ValueError, match=r"normal_space is 'view': expected one of 'camera', .*'world'"):
        named_space("view", seen[2])
