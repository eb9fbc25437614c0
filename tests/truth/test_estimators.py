"""Versions of estimators: what each gives for a small scene, recorded for its version.

If a test fails because an estimator was changed on purpose, raise its version in
`ssgi_cl.truth.estimators` and record the new values here: stored truths are then computed anew.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from ssgi_cl import truth
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.techniques.ao.gtao import GtaoParams
from ssgi_cl.techniques.ao.ssao import SsaoParams
from ssgi_cl.techniques.presets.speed_model import rolling_ground
from ssgi_cl.truth import assumption, slices
from ssgi_cl.truth.estimators import VERSIONS
from ssgi_cl.truth.store import Truth

pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")
pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")

VIEW = BUILTIN_SCENES["cornell_box"]()
CAMERA = VIEW.camera(width=24, height=18)
HILLS = rolling_ground((18, 24))
FACING = GBuffer(
    camera=CAMERA, depth=np.full((18, 24), 3.0, np.float32), normal=np.tile(np.float32([0.0, 0.0, 1.0]), (18, 24, 1))
)

GLOSSY = replace(
    VIEW.scene,
    materials=tuple(
        replace(m, albedo=(0.4, 0.4, 0.4), specular=(0.5, 0.4, 0.3), gloss=20.0) for m in VIEW.scene.materials
    ),
)

BLENDED = replace(
    VIEW.scene,
    materials=tuple(
        replace(m, albedo=(0.4, 0.4, 0.4), transmission=(0.1, 0.2, 0.3), alpha=0.7, blends=True)
        for m in VIEW.scene.materials
    ),
)

ESTIMATES: dict[str, Callable[[], Truth]] = {
    "occlusion": lambda: truth.ambient_occlusion(VIEW.scene, CAMERA, 0.5, 64, rebuild=True),
    "bent normals": lambda: truth.bent_normals(VIEW.scene, FACING, 0.5, 64, rebuild=True),
    "layered occlusion": lambda: truth.layered_occlusion(HILLS, 0.5, 64, rebuild=True),
    "ssao": lambda: assumption.ssao(HILLS, SsaoParams(radius=0.5), 128, rebuild=True),
    "slices": lambda: slices.converged(HILLS, GtaoParams(radius=0.5), pixels=256, slices=16, rebuild=True),
    "light": lambda: truth.one_bounce(VIEW.scene, CAMERA, VIEW.lights, 16, rebuild=True),
    "radiance": lambda: truth.radiance(VIEW.scene, CAMERA, VIEW.lights, 16, 2, rebuild=True),
    "glossy radiance": lambda: truth.radiance(GLOSSY, CAMERA, VIEW.lights, 16, 2, rebuild=True),
    "blended radiance": lambda: truth.radiance(BLENDED, CAMERA, VIEW.lights, 16, 2, rebuild=True),
}

RECORDED: dict[str, tuple[int, float, float]] = {
    "occlusion": (1, 0.5684317, 0.00218099),
    "bent normals": (1, -0.333076, 0.0003344997),
    "layered occlusion": (1, 0.9406467, 0.001123405),
    "ssao": (2, 0.7220457, -0.00263692),
    "slices": (2, 0.5049434, 0.00195346),
    "light": (1, 0.0615814, -4.335898e-05),
    "radiance": (1, 0.1801964, 0.0004950036),
    "glossy radiance": (1, 0.2130869, 2.599315e-05),
    "blended radiance": (1, 0.1004600, 0.001567964),
}
"""Estimator -> its version, the mean of the result, and its mean weighted by a pattern that no two
pixels have alike."""

TOLERANCE = 2e-4
"""Relative to the mean. Rays that graze an edge may fall to either side on another processor: one
of 64 of one of 432 pixels is 4e-5."""


def summary(found: Truth) -> tuple[float, float]:
    """Return two numbers that hardly any change of an image leaves alone."""
    image = np.where(np.isfinite(found.mean), found.mean, 0.0).astype(np.float64)
    pattern = np.cos(np.arange(image.size) * 2.399963).reshape(image.shape)
    return float(image.mean()), float((image * pattern).mean())


def test_every_estimator_is_recorded_with_its_version() -> None:
    assert {name: row[0] for name, row in RECORDED.items()} == VERSIONS


@pytest.mark.parametrize("name", sorted(ESTIMATES))
def test_result_is_that_recorded_for_the_version(name: str) -> None:
    found = summary(ESTIMATES[name]())
    _, *expected = RECORDED[name]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=TOLERANCE * abs(expected[0]))
