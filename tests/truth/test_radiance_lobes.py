"""World truth of radiance where surfaces have Phong lobes: closed forms, and Mitsuba's own path."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, Light
from ssgi_cl.core.scene import Material
from ssgi_cl.truth.radiance import radiance

from .surfaces import FLOOR, ROUNDING, above, closely, down, quads

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")

ALBEDO, SPECULAR = (0.3, 0.2, 0.1), (0.5, 0.4, 0.2)


def glossy(gloss: float, albedo: Sequence[float] = ALBEDO, specular: Sequence[float] = SPECULAR) -> Material:
    first, second = ((a, b, c) for a, b, c in (albedo, specular))
    return Material(albedo=first, specular=second, gloss=gloss)


def from_above(gloss: float, light: Sequence[Light], paths: int = 4) -> np.ndarray:
    """Return the radiance of a glossy floor straight below a distant camera."""
    scene = quads(FLOOR, materials=[glossy(gloss)])
    return radiance(scene, down(1, 1), light, paths, 0).mean[0, 0].astype(np.float64)


@pytest.mark.parametrize(("gloss", "tilt"), [(1.0, 1.2), (7.5, 0.3), (60.0, 0.0), (60.0, 0.3)])
def test_a_directional_light_is_reflected_by_the_closed_form(gloss: float, tilt: float) -> None:
    sun = DirectionalLight((math.sin(tilt), -math.cos(tilt), 0.0), 2.0)
    found = from_above(gloss, [sun])
    lobe = (gloss + 1.0) / (2.0 * math.pi) * math.cos(tilt) ** gloss
    expected = 2.0 * (np.array(ALBEDO) / math.pi * math.cos(tilt) + np.array(SPECULAR) * lobe)
    # The exponent multiplies the cosine's rounding.
    np.testing.assert_allclose(found, expected, rtol=ROUNDING * (1.0 + gloss))


def test_a_lobe_straight_up_reflects_an_even_sky_whole() -> None:
    # All of the lobe lies above the floor. Of an image, even an even one, texels are sampled too.
    scene = quads(FLOOR, materials=[glossy(4.0)])
    found = radiance(scene, down(96, 64), [Environment(np.full((4, 8, 3), (3.0, 2.0, 1.0)))], 4)
    closely(found, np.array((3.0, 2.0, 1.0)) * (np.array(ALBEDO) + SPECULAR), 1e-4)


def test_of_a_tilted_lobe_what_lies_below_the_surface_is_lost() -> None:
    gloss, tilt = 3.0, 1.0
    eye = (4.0 * math.sin(tilt), 4.0 * math.cos(tilt), 0.0)
    camera = Camera.look_at(eye, (0, 0, 0), width=96, height=72, yfov=0.001)
    scene = quads(FLOOR, materials=[glossy(gloss, (0, 0, 0), (1, 1, 1))])
    found = radiance(scene, camera, [Environment(np.ones((4, 8, 3)))], 4)
    # The share above, on a grid of directions: the floor's normal is `tilt` off the lobe's axis.
    cosine, turn = np.meshgrid((np.arange(400) + 0.5) / 400, 2.0 * math.pi * (np.arange(400) + 0.5) / 400)
    above_floor = cosine * math.cos(tilt) + np.sqrt(1.0 - cosine**2) * math.sin(tilt) * np.cos(turn) > 0.0
    share = float(((gloss + 1.0) * cosine**gloss * above_floor).mean())
    assert 0.8 < share < 0.97
    closely(found, share, 2e-4)


def test_the_lobe_has_what_the_albedo_leaves() -> None:
    """Else a closed room would shine ever brighter."""
    sun = [DirectionalLight((0.0, -1.0, 0.0), 2.0)]
    scenes = [
        quads(FLOOR, materials=[glossy(9.0, (0.75, 0.5, 1.0), specular)])
        for specular in ((1.0, 0.3, 0.5), (0.25, 0.3, 0.0))
    ]
    found = [radiance(scene, above(8, 6), sun, 4, 0).mean for scene in scenes]
    np.testing.assert_array_equal(found[0], found[1])
