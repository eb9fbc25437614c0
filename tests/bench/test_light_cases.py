"""Cases of virtual point lights held to all of their lights, and how errors of light are told."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from ssgi_cl.bench.cases import FAMILIES
from ssgi_cl.bench.drawn import GLOSS, polished
from ssgi_cl.bench.verdict import verdict
from ssgi_cl.bench.wording import rmse
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.reference.direct.shade import direct_reference, world_surface
from ssgi_cl.tuning.context import Context

from .documents import entry

SMALL = (24, 32)


def test_an_error_of_light_is_told_as_a_share_of_the_mean_too() -> None:
    light = entry(quantity="bounce", errors={"world": {"rmse": 0.05, "mean": 0.4}})
    assert rmse(light, "world") == "0.0500 (12.5 %)"
    assert rmse(light, "assumption") == "-"
    assert rmse(entry(rmse=0.05), "world") == "0.0500"  # of A


def test_paths_through_the_mesh_are_what_a_bounce_is_held_to() -> None:
    paths = entry("mitsuba-path-oidn.4.hall.8x6", 60.0, 0.1, quantity="bounce")
    own = entry("vpl-visibility.256.hall.8x6", 6.0, 0.2, quantity="bounce")
    said = verdict([paths, own])
    ours = "this library from 6.00 ms on, vpl-visibility.256 (RMSE 0.200, 6.00 ms); then"
    assert ours in said[0]
    assert "rays against the mesh from 60.0 ms on, mitsuba-path-oidn.4" in said[0]


def test_all_surfaces_of_a_polished_scene_mirror() -> None:
    assert {material.gloss for material in polished(cornell_box().scene).materials} == {GLOSS}


def test_direct_light_is_what_lights_send_less_shadows(runtime: Runtime) -> None:
    context = Context(runtime, cornell_box(), SMALL)
    subject = FAMILIES["direct"].prepare(context, "64")
    assert subject.image is not None
    image = subject.image()
    assert image.shape == (*SMALL, 3)
    *surface, _ = world_surface(context.host_gbuffer)
    wanted = sum(direct_reference(punctual_light, *surface) for punctual_light in context.punctual_lights)
    assert (image <= 1.001 * wanted + 1e-4).all()
    assert np.isclose(image, wanted, rtol=1e-3, atol=1e-4).mean() > 0.5


@pytest.mark.slow
def test_geometry_alone_computes_fewer_pixels_than_a_bound_of_the_error(runtime: Runtime) -> None:
    context = Context(runtime, cornell_box(), SMALL)
    shares = []
    for setting in ("geometry", "10-permille"):
        note = FAMILIES["multires-geometry"].prepare(context, setting).note
        found = re.search(r"([0-9.]+) % of the pixels computed", note)
        assert found
        shares.append(float(found[1]))
    assert shares[0] < shares[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("few", "many"), [("vpl-lobes.64", "vpl-lobes.4096"), ("vpl-cut.7-percent", "vpl-cut-restored.1-percent")]
)
def test_more_lights_and_a_lesser_cut_err_less_against_all_lights(runtime: Runtime, few: str, many: str) -> None:
    context = Context(runtime, cornell_box(), SMALL)
    errors = []
    for name in (few, many):
        family, setting = name.split(".")
        subject = FAMILIES[family].prepare(context, setting)
        assert subject.image is not None
        truth = subject.truths["assumption"]().mean
        errors.append(math.sqrt(np.mean((subject.image() - truth) ** 2)) / truth.mean())
    assert errors[1] < 0.5 * errors[0] < 1.0
