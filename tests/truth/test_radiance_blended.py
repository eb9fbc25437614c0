"""World truth of radiance where surfaces are seen through: closed forms, and Mitsuba's volpath."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.truth.radiance import radiance

from .surfaces import BOX, FLOOR, INSIDE, Quad, closely, down, grey, quads

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")

SUN = DirectionalLight((0.0, -1.0, 0.0), np.pi)
GREY = grey(0.5)
GLASS = Material(albedo=(0.1, 0.2, 0.1), transmission=(0.8, 0.6, 0.4))
SMOKE = Material(albedo=(0.6,) * 3, alpha=0.3, blends=True, alpha_cutoff=0.5)


def pane(height: float) -> Quad:
    """Return a wide pane above the floor."""
    return ((-5, height, -5), (0, 0, 10), (10, 0, 0))


def lit(scene: Scene, expected: np.ndarray) -> None:
    """Assert the radiance straight down, by the sun without bounces."""
    closely(radiance(scene, down(160, 120), [SUN], 4, 0), expected)


@pytest.mark.parametrize("cut_too", [False, True])
def test_light_passes_a_pane_on_its_way_down_and_up(cut_too: bool) -> None:
    # A cut-out elsewhere makes rays look for holes, which panes are not.
    through = np.array(GLASS.transmission)
    materials, parts, rest = [GREY, GLASS], [FLOOR, pane(1.0)], {}
    if cut_too:
        materials.append(replace(GREY, texture=0, alpha_cutoff=0.5))
        parts.append(((-5, 2, -5), (0, 0, 10), (10, 0, 0)))
        rest = {"textures": (np.zeros((1, 1, 4), np.uint8),)}
    lit(quads(*parts, materials=materials, **rest), np.array(GLASS.albedo) + 0.5 * through**2)


def test_what_is_there_of_a_blended_surface_shades_and_is_seen() -> None:
    expected = 0.3 * 0.6 + 0.7**2 * 0.5
    lit(quads(FLOOR, pane(1.0), materials=[GREY, SMOKE]), np.full(3, expected))


def test_the_alpha_of_a_texture_counts() -> None:
    texture = np.full((2, 2, 4), 255, np.uint8)
    texture[..., 3] = 51  # a fifth
    blended = replace(SMOKE, texture=0, alpha=0.5)
    scene = quads(FLOOR, pane(1.0), materials=[GREY, blended], textures=(texture,))
    lit(scene, np.full(3, 0.1 * 0.6 + 0.9**2 * 0.5))


def test_layers_dim_each_other() -> None:
    own, through = np.array(GLASS.albedo), np.array(GLASS.transmission)
    behind = own + 0.5 * through**2  # of glass over the floor, lit and seen through smoke
    scene = quads(FLOOR, pane(1.0), pane(2.0), materials=[GREY, GLASS, SMOKE])
    lit(scene, 0.3 * 0.6 + 0.7**2 * behind)


def test_a_sky_is_seen_through_a_pane_alone() -> None:
    camera = Camera.look_at((0, 2.0, 0), (0, 4.0, 0), up=(0, 0, 1), width=160, height=120, yfov=0.1)
    sky = np.array((3.0, 2.0, 1.0))
    scene = quads(pane(3.0), materials=[replace(GLASS, albedo=(0.0,) * 3)])
    closely(radiance(scene, camera, [Environment(tuple(sky))], 4, 0), sky * GLASS.transmission)


def test_transmission_has_what_albedo_and_lobe_leave() -> None:
    # A pane that is told to let through more than that darkens no sky, and brightens none.
    greedy = Material(albedo=(0.25,) * 3, specular=(0.25,) * 3, gloss=1e4, transmission=(1.0,) * 3)
    assert greedy.transmitted == (0.5, 0.5, 0.5)
    room = quads(pane(1.0), materials=[greedy])
    closely(radiance(room, down(160, 120), [Environment(2.0)], 4), 2.0)


@pytest.mark.slow
def test_a_room_with_panes_has_the_light_of_all_bounces() -> None:
    # Panes within a furnace change nothing: what they do not let through they send.
    clear = Material(albedo=(0.2,) * 3, transmission=(0.8,) * 3)
    scene = quads(*BOX, ((0.5, 0, 0), (0, 1, 0), (0, 0, 1)), materials=[grey(0.5, 1.0)] * 6 + [clear])
    closely(radiance(scene, INSIDE, [], 256), 2.0)
