"""Cases of slices and of virtual point lights, held to rays and to their own models; settings that are refused."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from ssgi_cl.bench import suite
from ssgi_cl.bench.cases import FAMILIES
from ssgi_cl.bench.cases.ao import ssao_subject
from ssgi_cl.bench.drawn import GLOSS, polished
from ssgi_cl.bench.verdict import verdict
from ssgi_cl.bench.wording import rmse
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.reference.ao.gtao import gtao_reference
from ssgi_cl.reference.direct.shade import direct_reference, world_surface
from ssgi_cl.techniques.ao.gtao import GtaoParams
from ssgi_cl.techniques.ao.ssao import SsaoParams
from ssgi_cl.tuning.case import Case
from ssgi_cl.tuning.context import Context, TruthSettings

from .documents import entry

pytestmark = pytest.mark.usefixtures("own_store")

SMALL = (45, 60)


def measured(runtime: Runtime, *names: str) -> suite.Measurements:
    cases = [Case(*name.split("."), "cornell_box", SMALL) for name in names]  # type: ignore[arg-type]
    return suite.measure(cases, {"cornell_box": cornell_box()}, runtime, truths=TruthSettings(rays=64), runs=4)


@pytest.mark.slow
def test_many_slices_and_taps_come_closer_to_the_model_than_few(runtime: Runtime) -> None:
    found = measured(runtime, "gtao-model.2x4", "gtao-model.8x32")
    assert found.skipped == []
    few, many = (result["errors"]["assumption"] for result in found.results)
    assert many["rmse"] < 0.3 * few["rmse"]
    assert abs(many["bias"]) < 0.1 * abs(few["bias"]) + 2e-3
    assert "world" not in found.results[0]["errors"]


def test_bent_normals_are_nearer_to_those_of_rays_than_the_surface_is(runtime: Runtime) -> None:
    pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")
    found = measured(runtime, "bent-normals.none", "bent-normals.2x9")
    assert found.skipped == []
    none, bent = found.results
    assert not none["timed"]
    assert bent["timed"]
    # Measured, degrees: 14 and 6.
    assert bent["errors"]["world"]["bias"] < 0.6 * none["errors"]["world"]["bias"]
    assert bent["errors"]["world"]["mrse"] is None  # of a truth of nothing but zeros
    assert found.pictures == {}


def test_the_published_setting_is_that_of_gtao_with_its_numbers(runtime: Runtime) -> None:
    context = Context(runtime, cornell_box(), SMALL)
    subject = FAMILIES["xegtao"].prepare(context, "high")
    assert subject.image is not None
    params = GtaoParams(slices=3, taps=3, radius=1.457 * context.radius, tap_power=2.0, falloff=0.615, contrast=2.2)
    wanted = gtao_reference(context.host_gbuffer, params)
    # A tap in a hundred may lie on the other side of a pixel's border, and the blur spreads it.
    assert np.mean(np.abs(subject.image() - wanted) > 1e-3) < 0.05


def test_presets_are_measured_with_the_layers_that_are_asked_for(runtime: Runtime) -> None:
    context = Context(runtime, cornell_box(), SMALL)
    low = FAMILIES["gtao-preset"].prepare(context, "low")
    deep = FAMILIES["gtao-preset"].prepare(context, "high-2")  # run in `test_drawn`
    assert low.counted == ""
    assert deep.counted == "G-buffer of 2 layers and 10 % overscan drawn"
    assert list(deep.truths) == ["world"]


def test_reads_are_counted_at_the_size_at_which_they_are_made(runtime: Runtime) -> None:
    context = Context(runtime, cornell_box(), SMALL)
    seen = np.count_nonzero(context.seen)
    for resolution, part in (("full", 1), ("half", 4), ("quarter", 16)):
        made = ssao_subject(context, SsaoParams(resolution=resolution, samples=12))
        assert made.samples == seen * 12 / part


@pytest.mark.parametrize(
    ("family", "setting", "message"),
    [
        ("gtao-preset", "best", "preset is 'best': expected one of"),
        ("gtao-preset", "high-99", "setting is '99': expected NAME-LAYERS, layers, 1 to"),
        ("hbao-model", "2x9-blurred", "setting is '2x9-blurred': expected SLICESxTAPS or"),
        *(
            ("floor", setting, rf"setting is '{setting}': expected LAYERS or LAYERS-OV")
            for setting in ("0", "17", "1-0", "1-100", "4x10", "many", "")
        ),
        ("frame", "best", "setting is 'best': expected one of 'default', 'low"),
        ("bent-normals", "2", "setting is '2': expected SLICESxTAPS, such as 2x9, or none"),
    ],
)
def test_a_wrong_setting_is_refused(family: str, setting: str, message: str, runtime: Runtime) -> None:
    with pytest.raises(ValueError, match=message):
        FAMILIES[family].prepare(Context(runtime, cornell_box(), SMALL), setting)


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
    context = Context(runtime, cornell_box(), (24, 32))
    subject = FAMILIES["direct"].prepare(context, "64")
    assert subject.image is not None
    image = subject.image()
    assert image.shape == (24, 32, 3)
    *surface, _ = world_surface(context.host_gbuffer)
    wanted = sum(direct_reference(punctual_light, *surface) for punctual_light in context.punctual_lights)
    assert (image <= 1.001 * wanted + 1e-4).all()
    assert np.isclose(image, wanted, rtol=1e-3, atol=1e-4).mean() > 0.5


@pytest.mark.slow
def test_geometry_alone_computes_fewer_pixels_than_a_bound_of_the_error(runtime: Runtime) -> None:
    context = Context(runtime, cornell_box(), (24, 32))
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
    context = Context(runtime, cornell_box(), (24, 32))
    errors = []
    for name in (few, many):
        family, setting = name.split(".")
        subject = FAMILIES[family].prepare(context, setting)
        assert subject.image is not None
        truth = subject.truths["assumption"]().mean
        errors.append(math.sqrt(np.mean((subject.image() - truth) ** 2)) / truth.mean())
    assert errors[1] < 0.5 * errors[0] < 1.0
