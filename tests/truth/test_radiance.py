"""World truth of radiance: furnaces, the other truths, Mitsuba's own path integrator."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.core.scene import Scene
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.direct.shade import sky_reference
from ssgi_cl.truth import mitsuba_scene, radiance_tracer, store
from ssgi_cl.truth.light import direct_light, one_bounce
from ssgi_cl.truth.radiance import radiance
from ssgi_cl.truth.radiance_tracer import RadianceTracer

from .surfaces import BOX, FLOOR, INSIDE, PANEL, above, closely, grey, quads
from .test_mitsuba_scene import Albedo

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")


# ---- closed forms


@pytest.mark.parametrize(
    ("albedo", "bounces"),
    [
        (0.8, "all"),
        (0.7, 0),
        (0.7, 5),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in ((0.5, "all"), (0.7, 1))),
    ],
)
def test_furnace_shines_as_the_geometric_series(albedo: float, bounces: Any) -> None:
    furnace = quads(*BOX, materials=[grey(albedo, 2.0)])
    # Emission is seen, and reflected once more than light bounces.
    terms = 200 if bounces == "all" else bounces + 2
    camera = replace(INSIDE, width=72, height=48)
    closely(radiance(furnace, camera, [], 4, bounces), 2.0 * sum(albedo**k for k in range(terms)))


@pytest.mark.slow
def test_emission_is_seen_from_both_sides_and_lights_both() -> None:
    scene = quads(FLOOR, PANEL, materials=[grey(0.0), grey(0.0, 3.0)])
    for height in (2.0, 0.5):
        camera = Camera.look_at((0, height, 0), (0, 1, 0), (0, 0, 1), width=8, height=8, yfov=0.3)
        np.testing.assert_allclose(radiance(scene, camera, [], 4).mean, 3.0, rtol=1e-6)
    lit = [
        radiance(
            quads(FLOOR, part, materials=[grey(0.5), grey(0.0, 3.0)]),
            Camera.look_at((0, 0.5, 0), (0, 0, 0), (0, 0, 1), width=8, height=8, yfov=0.3),
            [],
            256,
            0,
        )
        for part in (PANEL, (PANEL[0], PANEL[2], PANEL[1]))
    ]
    closely(lit[0], lit[1].mean, lit[1].error)


@pytest.mark.slow
def test_cut_out_emission_shines_where_it_is_not_cut_out() -> None:
    texture = np.zeros((8, 8, 4), np.uint8)
    texture[:, :4, 3] = 255  # half of it is there
    material = replace(grey(0.0, 3.0), texture=0, alpha_cutoff=0.5)
    floor = Camera.look_at((0, 0.5, 0), (0, 0, 0), (0, 0, 1), width=8, height=8, yfov=0.3)
    holes = quads(FLOOR, PANEL, materials=[grey(0.5), material], textures=(texture,))
    whole = radiance(quads(FLOOR, PANEL, materials=[grey(0.5), grey(0.0, 3.0)]), floor, [], 256, 0)
    halved = radiance(holes, floor, [], 256, 0)
    assert 0.4 < halved.mean.mean() / whole.mean.mean() < 0.6


# ---- other truths


def parlour() -> tuple[Scene, Camera, Sequence[Light]]:
    view = BUILTIN_SCENES["parlour"]()
    return view.scene, view.camera(48, 36), view.lights


def bright_texel() -> tuple[Scene, Camera, Sequence[Light]]:
    """Return a wall on a floor, and a sky of which sampling by importance matters."""
    image = np.full((8, 16, 3), 0.05)
    image[1, 5] = 40.0
    scene = quads(FLOOR, ((-1, 0, -1), (0, 2, 0), (0, 0, 2)), materials=[grey(0.6)])
    camera = Camera.look_at((3, 3, 2), (0.5, 0, 0), width=24, height=16, yfov=0.4)
    return scene, camera, [Environment(image)]


@pytest.mark.slow
@pytest.mark.parametrize(("make", "paths"), [(parlour, 128), (bright_texel, 256)])
def test_one_bounce_and_direct_light_add_up_to_the_radiance(make: Any, paths: int) -> None:
    scene, camera, lights = make()
    variant = mitsuba_scene.best_variant()
    with mitsuba_scene.within(variant):
        albedo = Albedo(scene, lights, variant).image(camera, 1, 0)
    assert (albedo > 0.0).any(axis=-1).all(), "something is seen everywhere"
    direct, bounce = (make(scene, camera, lights, paths) for make in (direct_light, one_bounce))
    share = albedo / math.pi
    found = [radiance(scene, camera, lights, paths, bounces) for bounces in (0, 1)]
    closely(found[0], share * direct.mean, share * direct.error)
    closely(found[1], share * (direct.mean + bounce.mean), share * np.hypot(direct.error, bounce.error))


def test_without_bounces_lights_alone_are_exact_and_emission_is_added() -> None:
    scene = quads(FLOOR, materials=[grey(0.6, 0.25)])
    lights: list[Light] = [PointLight((0.3, 1.2, -0.2), (7.0, 5.0, 3.0)),
                           SpotLight((0, 2, 0), (0, -1, 0), 0.4, 3.0)]  # fmt: skip
    dark = quads(FLOOR, materials=[grey(0.6)])
    found = radiance(dark, above(), lights, bounces=0)
    assert found.passes == 1
    assert (found.error == 0.0).all()
    expected = 0.6 / math.pi * direct_light(dark, above(), lights).mean
    np.testing.assert_allclose(found.mean, expected, rtol=1e-6)
    glowing = radiance(scene, above(), lights, 1, 0)
    np.testing.assert_allclose(glowing.mean, expected + 0.25, rtol=1e-5)  # a plane lights no plane


def test_where_nothing_is_the_environments_are_seen(rng: np.random.Generator) -> None:
    image = rng.random((6, 9, 3))
    lights = [Environment(image), Environment((0.1, 0.2, 0.3))]
    camera = Camera.look_at((0, 3, 2), (0, 1, 0), width=32, height=24, yfov=1.4)
    found = radiance(quads(PANEL, materials=[grey(0.0)]), camera, lights, 1)
    expected = sky_reference(lights, camera)
    away = (found.mean != 0.0).any(axis=-1)
    assert 0.3 < away.mean() < 0.95
    # Texels end at roundings of float32 directions: of a few pixels at most.
    same = np.isclose(found.mean, expected, rtol=1e-5).all(axis=-1)
    assert (same == away).mean() > 0.995
    assert (radiance(quads(PANEL, materials=[grey(0.0)]), camera, [], 1).mean == 0.0).all()


def test_box_filter_is_the_mean_of_sixteen_cameras() -> None:
    # A sphere of edges: a black grid before a glowing wall, without noise in either.
    bars = [((0.2 * i - 1.0, -1, 0), (0.07 + 0.01 * i, 0, 0), (0.3, 2, 0)) for i in range(10)]
    scene = quads(*bars, ((-3, -3, -1), (6, 0, 0), (0, 6, 0)),
                  materials=[grey(0.0)] * 10 + [grey(0.0, 1.0)])  # fmt: skip
    camera = Camera.look_at((0, 0, 2), (0, 0, 0), width=24, height=16, yfov=0.8)
    fine = Camera.look_at((0, 0, 2), (0, 0, 0), width=96, height=64, yfov=0.8)
    centres = radiance(scene, fine, [], 1, 0).mean[..., 0]
    expected = centres.reshape(16, 4, 24, 4).mean(axis=(1, 3))
    found = radiance(scene, camera, [], 128, 0, box_filter=True).mean[..., 0]
    # 16 samples miss the area covered by an edge by at most about 1 / 8 of a pixel.
    np.testing.assert_allclose(found, expected, atol=0.13)
    assert abs(float((found - expected).mean())) < 0.01
    assert np.ptp(found) > 0.9
    assert ((found > 0.1) & (found < 0.9)).mean() > 0.2


# ---- noise


@pytest.mark.slow
def test_error_tells_how_far_repeated_truths_are_apart() -> None:
    view = BUILTIN_SCENES["terrace"]()  # whose noise has no long tail
    camera = view.camera(24, 18)
    with mitsuba_scene.within(mitsuba_scene.best_variant()):
        tracer = RadianceTracer(view.scene, view.lights, mitsuba_scene.best_variant())
        images = np.stack([tracer.image(camera, 8, 1000 + seed) for seed in range(10)])
    truth = radiance(view.scene, camera, view.lights, 64)
    assert truth.passes == 8
    # Of one pass of 8 paths, by ten of them over 1,296 values; the truth's is of the mean of 8 passes.
    spread = math.sqrt(float(images.var(axis=0, ddof=1).mean())) / math.sqrt(8.0)
    told = math.sqrt(float((truth.error.astype(np.float64) ** 2).mean()))
    assert 0.7 < told / spread < 1.4


def test_passes_are_independent_and_repeatable() -> None:
    view = BUILTIN_SCENES["cornell_box"]()
    camera = view.camera(24, 18)
    with mitsuba_scene.within(mitsuba_scene.best_variant()):
        tracer = RadianceTracer(view.scene, view.lights, mitsuba_scene.best_variant())
        images = [tracer.image(camera, 4, seed) for seed in range(12)]
        again = tracer.image(camera, 4, 3)
    np.testing.assert_array_equal(images[3], again)
    off = np.stack(images).astype(np.float64)
    off = (off - off.mean(axis=0)).reshape(12, -1)
    related = np.corrcoef(off)[np.triu_indices(12, 1)]
    assert abs(related.mean() + 1.0 / 11.0) < 0.02  # of deviations from their own mean
    assert np.abs(related).max() < 0.3


# ---- the store, bad input


def test_truths_are_kept_apart_by_what_determines_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RadianceTracer, "image", lambda self, camera, paths, seed: np.zeros((*camera.size, 3)))
    scene = quads(FLOOR, materials=[grey(0.6)])
    sun = [DirectionalLight((0.3, -1.0, 0.4), 2.0)]
    made = [
        radiance(scene, above(8, 6), sun, 4, *bounces, box_filter=box).key
        for bounces in ((), (0,), (1,))
        for box in (False, True)
    ]
    assert len(set(made)) == 6
    assert radiance(scene, above(8, 6), sun, 4, "all").key == made[0]
    assert len(store.stored()) == 6


def test_surfaces_that_absorb_nothing_end_all_the_same() -> None:
    furnace = quads(*BOX, materials=[grey(1.0, 1.0)])
    found = radiance(furnace, replace(INSIDE, width=4, height=3), [], 4)
    assert np.isfinite(found.mean).all()
    assert (found.mean > 5.0).all()


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"paths": 0}, ValueError, "paths is 0"),
        ({"paths": 2.5}, TypeError, "paths"),
        ({"bounces": -1}, ValueError, "bounces is -1"),
        ({"bounces": 1025}, ValueError, "bounces is 1025: expected"),
        ({"bounces": 1.5}, TypeError, "bounces"),
        ({"bounces": True}, TypeError, "bounces"),
        ({"bounces": "many"}, ValueError, "bounces is 'many': expected 'all' or an integer, 0 to"),
        ({"box_filter": 1}, TypeError, "box_filter"),
        ({"lights": ["sun"]}, TypeError, r"lights\[0\] is str: expected a light"),
    ],
)
def test_bad_arguments_are_named(change: dict[str, Any], error: type[Exception], message: str) -> None:
    scene = quads(FLOOR, materials=[grey(0.5)])
    with pytest.raises(error, match=message):
        radiance(**{"scene": scene, "camera": above(), "lights": [Environment(1.0)], **change})


def test_paths_are_cut_at_the_most_bounces() -> None:
    assert radiance_tracer.MOST_LASTING**radiance_tracer.MOST_BOUNCES < 1e-20
