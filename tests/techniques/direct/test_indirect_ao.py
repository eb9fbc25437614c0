"""Light that surfaces reflect, dimmed by ambient occlusion; lights with lobes in the pipeline."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.lights import SpotLight
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import render
from ssgi_cl.frame.result import Frame
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.direct.shade import shade_reference
from ssgi_cl.techniques.direct.shade import Shade, ShadeParams, shade

from ..analytic import camera, scene
from ..vpl.test_vpl_glossy import SPOT, polished_scene


def box(runtime: Runtime, **options: Any) -> Frame:
    made = BUILTIN_SCENES["cornell_box"]()
    return render(
        made.scene,
        made.camera(48, 36),
        made.lights,
        bounces=0,
        exposure=1.0,
        shadow_size=64,
        vpls=64,
        runtime=runtime,
        **{"ao_radius": made.ao_radius, **options},
    )


@pytest.mark.parametrize("with_ao", [False, True])
def test_shading_agrees_with_float64_reference(
    variant_runtime: Runtime, rng: np.random.Generator, with_ao: bool
) -> None:
    gbuffer = scene("corner", camera(), rng)
    ao = rng.random(gbuffer.size).astype(np.float32) if with_ao else None
    indirect = rng.random((*gbuffer.size, 3)).astype(np.float32)
    lights = [SpotLight((0.0, 1.0, 1.0), (0.0, -1.0, -1.0), 1.0, 2.0)]
    options: Any = {"ao": ao, "indirect": indirect, "indirect_ao": True}
    found = shade(gbuffer, lights, runtime=variant_runtime, **options)
    # As of shading without it: some roundings of 2^-24.
    np.testing.assert_allclose(found, shade_reference(gbuffer, lights, **options), rtol=2e-5, atol=1e-6)


@pytest.mark.parametrize("indirect", ["multires", "gather"])
def test_ambient_occlusion_dims_reflected_light_where_asked_to(runtime: Runtime, indirect: str) -> None:
    plain, dimmed = (box(runtime, indirect=indirect, indirect_ao=choice) for choice in (False, True))
    assert plain.ao is None  # there is no ambient light for it to dim
    assert dimmed.ao is not None
    assert plain.indirect is not None
    assert dimmed.indirect is not None
    np.testing.assert_array_equal(plain.indirect, dimmed.indirect)
    added, kept = (frame.radiance - box(runtime).radiance for frame in (plain, dimmed))
    # Differences of radiance, of which each is rounded.
    np.testing.assert_allclose(kept, added * dimmed.ao[..., None], rtol=1e-4, atol=1e-6 * plain.radiance.max())


@pytest.mark.parametrize(
    ("options", "share"),
    [
        ({"gaps": True}, lambda a: np.minimum(2.0 * a, 1.0)),
        ({"gaps": True, "indirect_ao": True}, lambda a: a),
        ({}, np.ones_like),
    ],
)
def test_gaps_dim_bounces_and_occlusion_dims_the_sky(
    variant_runtime: Runtime, rng: np.random.Generator, options: Any, share: Any
) -> None:
    runtime = variant_runtime
    gbuffer = on_device(scene("corner", camera(), rng), runtime)
    ao = rng.random(gbuffer.size).astype(np.float32)
    indirect, sky = rng.random((2, 3, *gbuffer.size)).astype(np.float32)
    planes = [runtime.plane(len(values), gbuffer.size) for values in (ao[None], indirect, sky)]
    for plane, values in zip(planes, (ao[None], indirect, sky), strict=True):
        plane.upload(values)
    technique = Shade(runtime, gbuffer.size, ShadeParams(multi_bounce=False))
    found = technique.combine(
        gbuffer, [], None, ambient=False, visibility=planes[0], indirect=planes[1], sky_light=planes[2], **options
    ).download()
    albedo, there = gbuffer.albedo.download(), np.isfinite(gbuffer.depth.download()[0])
    expected = albedo / np.pi * (share(ao.astype(np.float64)) * indirect + ao * sky)
    # Some roundings of 2^-24.
    np.testing.assert_allclose(found[:, there], expected[:, there], rtol=2e-6)


def test_lights_with_lobes_are_drawn_chosen_and_shot(runtime: Runtime) -> None:
    made = polished_scene()
    view = camera(size=(45, 60), eye=(0.3, 1.0, 3.0), target=(0.0, 0.6, 0.0))
    options: Any = {"indirect": "vpl", "vpls": 64, "shadow_size": 64, "exposure": 1.0, "runtime": runtime}
    matt, glossy = (render(made, view, [SPOT], bounces=0, glossy_vpls=count, **options).indirect for count in (0, 256))
    assert matt is not None
    assert glossy is not None
    # Without lobes what they reflect goes all ways: less where they point, more beside.
    assert glossy.mean() > 1.2 * matt.mean()
    assert (glossy < matt - 1e-3 * matt.max()).any()


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"indirect_ao": 2}, TypeError, r"indirect_ao is 2: expected True or False"),
        (
            {"indirect_ao": True},
            ValueError,
            r"indirect_ao is True: expected False with ao=True "
            r"and indirect=None",
        ),
        ({"indirect_ao": True, "ao": False, "indirect": True}, ValueError, r"ao=False"),
        ({"indirect_ao": True, "indirect": "ssdo"}, ValueError, r"indirect='ssdo'"),
        ({"glossy_vpls": 8, "indirect": True}, ValueError, r"glossy_vpls is 8: expected 0 with"),
        ({"glossy_vpls": -1, "indirect": "vpl"}, ValueError, r"glossy_vpls is -1: expected an"),
    ],
    ids=str,
)
def test_bad_arguments_are_refused(
    runtime: Runtime, options: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        box(runtime, **options)
