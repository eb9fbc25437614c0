"""World truths of light beside Mitsuba's own integrators, and those of one variant beside another's."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Environment, Light, PointLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.truth import mitsuba_scene
from ssgi_cl.truth.light import direct_light, one_bounce
from ssgi_cl.truth.mitsuba_scene import MitsubaScene
from ssgi_cl.truth.radiance import radiance
from ssgi_cl.truth.store import Truth

from ..techniques.analytic import slow_but
from .surfaces import BOX, INSIDE, PATCH, closely, grey, quads

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")

Floats = NDArray[np.float32]

SKY = np.full((4, 8, 3), 0.3)
SKY[0, 3] = 9.0
POINT = PointLight((0.5, 0.5, 0.5), 0.5)
GLOSSY = Material(albedo=(0.5, 0.4, 0.3), specular=(0.3, 0.3, 0.2), gloss=12.0)
PANES = (
    Material(albedo=(0.6,) * 3, texture=0, blends=True, alpha_cutoff=0.5),
    Material(albedo=(0.2,) * 3, transmission=(0.5,) * 3),
)


def box(material: Material, *panes: Material) -> Scene:
    """Return a closed box with a glowing patch, and panes in it."""
    parts = ((0.2, 0.2, 0.4), (0.5, 0, 0), (0, 0.6, 0)), ((0.3, 0.5, 0.2), (0, 0, 0.5), (0.5, 0.1, 0))
    texture = np.full((1, 1, 4), 153, np.uint8)  # .6
    materials = [material] * 6 + [grey(0.3, 5.0), *panes]
    return quads(*BOX, PATCH, *parts[: len(panes)], materials=materials, textures=(texture,))


SCENES: dict[str, tuple[Scene, Camera, Sequence[Light]]] = {
    "grey below a sky": (
        quads(*BOX[:5], PATCH, materials=[grey(0.6)] * 5 + [grey(0.3, 5.0)]), INSIDE, [Environment(SKY), POINT],
    ),
    "glossy below a sky": (quads(*BOX[:5], materials=[GLOSSY]), INSIDE, [Environment(SKY), POINT]),
    "glossy": (box(GLOSSY), INSIDE, [POINT]),
    "panes": (box(Material(albedo=(0.5, 0.4, 0.3)), *PANES), INSIDE, [PointLight((0.6, 0.7, 0.6), 0.5)]),
    "soft": (box(GLOSSY), INSIDE, [PointLight((0.5, 0.5, 0.5), 0.5, radius=0.1)]),
}  # fmt: skip


def mitsubas_own(
    scene: Scene, camera: Camera, lights: Sequence[Light], samples: int, **options: Any
) -> tuple[Floats, Floats]:
    """Return the mean of four images by an integrator of Mitsuba's own, and its standard error."""
    variant = mitsuba_scene.best_variant()
    if variant == "scalar_rgb":
        pytest.skip("too slow without LLVM 17 or later")
    with mitsuba_scene.within(variant) as mi:
        world = MitsubaScene.of(scene, lights, variant, emission="emitters", lobes="surfaces", through="surfaces")
        integrator = mi.load_dict({"max_depth": -1, **options})
        sensor = mi.load_dict(mitsuba_scene.sensor(mi, world, camera))
        images = [
            np.array(mi.render(world.scene, sensor=sensor, integrator=integrator, spp=samples, seed=seed))
            for seed in range(4)
        ]
    return np.mean(images, axis=0), np.std(images, axis=0, ddof=1) / 2.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell_box", "parlour", "workshop"])  # the last is glossy
def test_mitsubas_own_integrator_finds_the_same_in_scenes(name: str) -> None:
    view = BUILTIN_SCENES[name]()
    camera = view.camera(40, 30)
    found = radiance(view.scene, camera, view.lights, 128, box_filter=True)
    closely(found, *mitsubas_own(view.scene, camera, view.lights, 64, type="path", rr_depth=8))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "paths", "kind", "rr_depth"),
    [
        ("glossy", 512, "path", 8),
        ("glossy below a sky", 512, "path", 8),
        # Its integrator `path` takes panes for opaque on the way from a light.
        ("panes", 1024, "volpath", 32),
    ],
)
def test_mitsubas_own_integrator_finds_the_same(name: str, paths: int, kind: str, rr_depth: int) -> None:
    found = radiance(*SCENES[name], paths, box_filter=True)
    closely(found, *mitsubas_own(*SCENES[name], paths // 4, type=kind, rr_depth=rr_depth))


MAKERS: dict[str, Callable[..., Truth]] = {
    "radiance": partial(radiance, box_filter=True),
    "direct light": direct_light,
    "one bounce": one_bounce,
    "without visibility": partial(one_bounce, visibility=False),
}


def agrees(make: Callable[..., Truth], name: str, rows: int, paths: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Assert that a truth is the same without LLVM."""
    scene, camera, lights = SCENES[name]
    camera = replace(camera, width=6, height=rows)
    fast = make(scene, camera, lights, paths)
    monkeypatch.setattr(mitsuba_scene, "best_variant", lambda: "scalar_rgb")
    slow = make(scene, camera, lights, paths)
    assert slow.key != fast.key
    # The same random numbers: they differ by roundings, and where these decide what is hit.
    np.testing.assert_allclose(slow.mean.mean(), fast.mean.mean(), rtol=0.01)
    assert np.isclose(slow.mean, fast.mean, rtol=1e-3, atol=1e-4).mean() > 0.95


@pytest.mark.parametrize("maker", slow_but(MAKERS, "radiance", "one bounce"))
def test_scalar_variant_agrees(maker: str, monkeypatch: pytest.MonkeyPatch) -> None:
    agrees(MAKERS[maker], "grey below a sky", 1, 2, monkeypatch)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_scalar_variant_agrees_on_all_surfaces(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    agrees(MAKERS["radiance"], name, 4, 32, monkeypatch)
