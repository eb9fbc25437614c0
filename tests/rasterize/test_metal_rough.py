"""Metal and roughness as albedo and a Phong lobe."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.files.metal_rough import LEAST_GLOSS, MOST_GLOSS, Lobe, metal_rough_lobe

from .meshes import made

BASE = np.array((0.9, 0.5, 0.2))


def test_a_metal_mirrors_its_colour_and_is_black_otherwise() -> None:
    lobe = metal_rough_lobe(BASE, 1.0, 0.5)
    assert lobe.matt == 0.0
    assert lobe.specular == pytest.approx(BASE)
    # GGX of a = 1/4 and a Phong lobe of 2 / a^2 - 2 = 30 are equally wide.
    assert lobe.gloss == pytest.approx(30.0)


@pytest.mark.parametrize(("base", "matt"), [((1.0, 1.0, 1.0), 0.96), ((0.0, 0.0, 1.0), 0.96), ((0.9, 0.5, 0.0), 1.0)])
def test_what_is_no_metal_mirrors_4_percent_and_its_albedo_has_the_rest(base: Any, matt: float) -> None:
    lobe = metal_rough_lobe(np.array(base), 0.0, 0.5)
    assert lobe.specular == pytest.approx((0.04, 0.04, 0.04))
    assert lobe.matt == pytest.approx(matt)


def test_rough_surfaces_are_matt() -> None:
    assert metal_rough_lobe(BASE, 1.0, 1.0) == Lobe()
    roughness = np.linspace(0.0, 1.0, 101)
    gloss = [metal_rough_lobe(BASE, 1.0, r).gloss for r in roughness]
    assert gloss[0] == MOST_GLOSS
    assert all(a >= b for a, b in itertools.pairwise(gloss))
    assert all(g == 1.0 or g >= LEAST_GLOSS for g in gloss)


def test_numbers_beyond_their_range_count_as_the_nearest_within() -> None:
    assert metal_rough_lobe(BASE, 7.0, -1.0) == metal_rough_lobe(BASE, 1.0, 0.0)


def test_frames_without_lobes_take_metals_for_matt(runtime: Runtime) -> None:
    built = made("cornell_box")
    metal: dict[str, Any] = {"albedo": (0.0,) * 3, "specular": (0.5,) * 3, "gloss": 30.0}
    matt: dict[str, Any] = {"albedo": gi.Material(**metal).spread}
    kept: dict[str, Any] = {"outputs": ("radiance",), "ao": False, "shadow_size": 32, "runtime": runtime}

    def radiance(change: dict[str, Any], **options: Any) -> np.ndarray:
        materials = tuple(m if m.emits else replace(m, **change) for m in built.scene.materials)
        scene = replace(built.scene, materials=materials)
        return gi.render(scene, built.camera(32, 24), built.lights, **kept, **options).radiance

    for options in ({"bounces": 0}, {"indirect": "gather"}):
        one, other = (radiance(change, **options) for change in (metal, matt))
        np.testing.assert_array_equal(one, other)
        assert one.mean() > 0.0
