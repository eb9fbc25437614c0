"""Small bright sources of environments: how they are told apart, and the frames that they light."""

from __future__ import annotations

import gc
import weakref
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl import Environment
from ssgi_cl.core.environment_samples import texels
from ssgi_cl.core.suns import MOST_SUNS, lights_with_suns, split_suns
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.passes import resources
from ssgi_cl.frame.renderer import Renderer
from ssgi_cl.rasterize.scenes import make_scene

from ..rasterize.meshes import scene_of

Doubles = NDArray[np.float64]

WAY = np.array([0.45, 0.75, 0.35]) / np.linalg.norm([0.45, 0.75, 0.35])
RED = np.array([1.0, 0.9, 0.6])


def sky(radius: float, share: float, way: Doubles = WAY, rows: int = 256, ground: float = 0.2) -> Environment:
    """Return a sky of 1 over a ground, with a sun of `radius` radians and a share of all flux."""
    towards, omega = texels(rows, 2 * rows)
    image = np.where(towards[..., 1:2] > 0.0, 1.0, ground) * np.ones(3)
    disc = towards @ way >= np.cos(radius)
    lights = luminous(image, omega)
    image += disc[..., None] * RED * (share / (1.0 - share) * lights / luminous(disc[..., None] * RED, omega))
    return Environment(image)


def luminous(image: Doubles, omega: Doubles) -> float:
    return float(((image @ [0.2126, 0.7152, 0.0722]) * omega).sum())


def flux(environment: Environment) -> Doubles:
    image = np.asarray(environment.radiance)
    total: Doubles = (image * texels(*image.shape[:2])[1][..., None]).sum(axis=(0, 1))
    return total


@pytest.mark.parametrize(
    ("radius", "way"), [(0.013, WAY), (0.02, [0.0, 1.0, 0.0]), (0.044, [0.1, 0.2, 0.99]), (0.013, [1e-3, -0.99, 0.1])]
)
def test_a_sun_becomes_one_light_and_nothing_is_lost(radius: float, way: Any) -> None:
    # Also at a pole, and where the image's last column meets its first.
    way = np.asarray(way) / np.linalg.norm(way)
    whole = sky(radius, 0.7, way, rows=512)
    suns, rest = split_suns(whole)
    (sun,) = suns
    away = np.asarray(sun.direction) / np.linalg.norm(sun.direction)
    assert -away @ way > np.cos(0.008)  # of texels of .0061
    assert sun.angle == pytest.approx(radius, rel=0.15)
    # Sums of half a million texels in float64 round by parts in 1e12.
    np.testing.assert_allclose(flux(rest) + sun.irradiance, flux(whole), rtol=1e-10)
    # The sky goes on where the sun was; at the horizon it is half ground.
    assert np.asarray(rest.radiance).max() == pytest.approx(1.0)
    assert float(np.asarray(sun.irradiance) @ [0.2126, 0.7152, 0.0722]) == pytest.approx(
        0.7 / 0.3 * luminous(np.asarray(rest.radiance), texels(512, 1024)[1]), rel=0.01
    )


def test_several_suns_and_what_is_none(rng: np.random.Generator) -> None:
    two = np.asarray(sky(0.02, 0.4).radiance) + np.asarray(sky(0.02, 0.3, -WAY).radiance)
    assert len(split_suns(Environment(two))[0]) == 2
    many = np.full((128, 256, 3), 1e-5)
    many[64, ::32] = 1.0
    assert len(split_suns(Environment(many))[0]) == MOST_SUNS
    even = rng.uniform(0.5, 1.0, (64, 128, 3))
    for none in (
        Environment(1.0),
        Environment(even),
        Environment(np.ones((1, 1, 3))),
        Environment(np.zeros((64, 128, 3))),
        sky(0.02, 0.05),  # too little of the light
        sky(0.14, 0.9),  # no small source
    ):
        suns, rest = split_suns(none)
        assert suns == ()
        assert rest is none


def test_a_source_of_any_strength_and_images_of_any_shape() -> None:
    for shape in ((1, 1), (1, 100_000), (100_000, 1), (2, 3), (62, 124), (64, 128)):
        image = np.zeros((*shape, 3))
        image[shape[0] // 3, shape[1] // 3] = 1e38
        suns, rest = split_suns(Environment(image))
        assert len(suns) == int(shape == (64, 128))
        assert np.isfinite(np.asarray(rest.radiance)).all()


def test_an_environment_is_split_once_and_not_kept_longer_than_used() -> None:
    a, b = sky(0.02, 0.7), sky(0.02, 0.01)
    for one in (a, b):
        first, again = split_suns(one), split_suns(one)
        assert first[1] is again[1]
        assert first[0] is again[0]
    gone = [weakref.ref(a), weakref.ref(b)]
    del a, b, one, first, again
    gc.collect()
    assert [each() for each in gone] == [None, None]


def test_other_lights_keep_their_places() -> None:
    point, plain, sunny = gi.PointLight((0, 1, 0), 1.0), Environment(1.0), sky(0.02, 0.7)
    assert lights_with_suns([point, plain]) == ((point, plain), None)
    lights, note = lights_with_suns([sunny, point, plain])
    assert lights[1:3] == (point, plain)
    assert lights[0] is split_suns(sunny)[1]
    assert lights[3:] == split_suns(sunny)[0]
    assert note is not None
    assert "directional light" in note


@pytest.mark.parametrize(("bounces", "told"), [("all", 1), (0, 0)])
def test_frames_of_all_bounces_are_lit_by_suns_and_show_the_sky_as_it_was_given(bounces: Any, told: int) -> None:
    lights = (sky(0.02, 0.7), gi.PointLight((0, 1, 0), 1.0))
    skips: list[tuple[Any, ...]] = []
    renderer: Any = SimpleNamespace(runtime=SimpleNamespace(skip=lambda *skip: skips.append(skip)))
    camera = gi.Camera.look_at((0, 0, 0), (0, 0, -1), width=4, height=3)
    params = FrameParams(bounces=bounces)
    given = Renderer._given(renderer, scene_of(np.eye(3)), camera, lights, params, 1.0)
    assert given[resources.SKY] == lights
    assert given[resources.LIGHTS] == (lights_with_suns(lights)[0] if told else lights)
    assert [name for name, *_ in skips] == ["suns"] * told


@pytest.mark.slow
def test_a_sun_in_an_environment_lights_a_frame_as_paths_do(runtime: Runtime) -> None:
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    built = make_scene("colonnade-11")
    camera = built.camera(80, 60)
    # The reference has one place a pixel.
    given: dict[str, Any] = {"preset": "medium", "exposure": 1.0, "edges": 0, "runtime": runtime}
    sunny = sky(0.013, 0.8, np.array([0.35, 0.8, 0.5]) / np.linalg.norm([0.35, 0.8, 0.5]))
    frame = gi.render(built.scene, camera, [sunny], **given)
    (told,) = [entry for entry in frame.passes if entry.name == "suns"]
    assert "W/m^2 from 1.5 degrees) are directional lights" in (told.skipped or "")
    truth = gi.truth.radiance(built.scene, camera, [sunny], paths=128).mean
    depth = np.asarray(gi.rasterize.gbuffer(built.scene, camera, runtime=runtime).depth)
    surface = np.isfinite(depth).reshape(60, 80)
    # The background still shows the sun, if it is seen, and its sky.
    np.testing.assert_allclose(frame.radiance[~surface], truth[~surface], rtol=0.02, atol=0.02)
    off = np.abs(frame.radiance - truth)[surface].mean() / truth[surface].mean()
    assert off < 0.15, off  # .10 here, .2 and more without a light of the sun's own


@pytest.mark.slow
def test_a_sun_in_an_environment_is_seen_and_lights_surfaces_as_the_directional_light_does(runtime: Runtime) -> None:
    built = make_scene("colonnade-11")
    sunny = sky(0.02, 0.8)
    given: dict[str, Any] = {"preset": "low", "exposure": 1.0, "runtime": runtime}
    camera = built.camera(48, 36)
    frame = gi.render(built.scene, camera, [sunny], **given)
    (told,) = [entry for entry in frame.passes if entry.name == "suns"]
    assert "directional light" in (told.skipped or "")
    (sun,), rest = split_suns(sunny)
    surface = np.isfinite(np.asarray(gi.rasterize.gbuffer(built.scene, camera, runtime=runtime).depth)).reshape(36, 48)
    expected = gi.render(built.scene, camera, [rest, sun], **given).radiance
    np.testing.assert_array_equal(frame.radiance[surface], expected[surface])
    dark = gi.render(built.scene, camera, [rest], **given).radiance
    assert frame.radiance[surface].mean() > 2.0 * dark[surface].mean()
    up = np.array([0.0, 1.0, 0.0])
    above = np.asarray(built.scene.bounds).max(axis=0) + 10.0
    camera = gi.Camera.look_at(above, above + WAY, up, yfov=0.1, width=16, height=12)
    seen = gi.render(built.scene, camera, [sunny], **given).radiance
    assert seen.max() == pytest.approx(np.asarray(sunny.radiance).max(), rel=1e-3)
