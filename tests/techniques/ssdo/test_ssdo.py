"""Directional occlusion and one-bounce light: the public technique with lights, back ends and layers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight
from ssgi_cl.core.params import Params
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, BuiltinScene
from ssgi_cl.techniques.direct.light_shadows import LightShadowParams
from ssgi_cl.techniques.direct.shade import shade
from ssgi_cl.techniques.filters.bilateral import BilateralParams
from ssgi_cl.techniques.ssdo.ssdo import Ssdo, ssdo
from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmaskParams
from ssgi_cl.techniques.ssdo.ssdo_params import METHODS, METHODS_OF, SsdoParams
from ssgi_cl.techniques.ssdo.ssdo_points import PointsParams
from ssgi_cl.techniques.ssdo.ssdo_stages import Senders, shape_of
from ssgi_cl.techniques.ssdo.ssdo_views import ViewsParams

from ..analytic import camera, scene, slow_but, tilted, trace

SUN = DirectionalLight((-0.3, -1.0, -0.5), (3, 2, 1))
LAMP = PointLight((0.3, 1.5, 1.2), (1, 2, 3))
SKY = Environment((0.2, 0.4, 0.6))
IMAGE = Environment(np.random.default_rng(3).random((8, 16, 3)))

Floats = NDArray[np.float32]

PUBLISHED_SLOW = slow_but(METHODS, "bitmask", "points")
"""Methods where "published" runs the same code as "points": its kernel has tests of its own."""


def means(irradiance: Floats) -> Floats:
    return irradiance.mean(axis=(0, 1))


@pytest.fixture
def corner(rng: np.random.Generator) -> GBuffer:
    """Two layers with all attributes and a margin."""
    front, back = (scene(name, camera(size=(40, 56)), rng, margin=(4, 6)) for name in ("corner", "ball"))
    depth = np.stack([np.asarray(front.depth), 8.0 * np.asarray(back.depth)])
    return GBuffer(
        camera=front.camera,
        depth=depth,
        normal=np.stack([np.asarray(each.normal) for each in (front, back)]),
        albedo=0.2 + 0.6 * rng.random((*depth.shape, 3), np.float32),
    )


def front_of(gbuffer: GBuffer) -> GBuffer:
    """Return the front layer with an albedo of 0.5."""
    depth, normal = gbuffer.first("depth"), gbuffer.first("normal")
    return GBuffer(camera=gbuffer.camera, depth=depth, normal=normal, albedo=np.full((*np.shape(depth), 3), 0.5))


# ---- light


@pytest.mark.parametrize("method", PUBLISHED_SLOW)
def test_a_plane_under_an_even_sky_gets_all_of_it_and_no_bounce(runtime: Runtime, method: str) -> None:
    made = camera(size=(32, 48))
    gbuffer = trace(made, [tilted(made, 40.0)])
    direct, bounce = ssdo(gbuffer, [SKY], runtime=runtime, method=method)
    expected = np.broadcast_to(np.pi * np.asarray(SKY.radiance), direct.shape)
    there = np.isfinite(np.asarray(gbuffer.depth))
    np.testing.assert_allclose(direct[there], expected[there], rtol=1e-5)  # a few roundings
    assert not bounce.any()


def test_bent_normals_change_neither_light(runtime: Runtime, rng: np.random.Generator) -> None:
    made, lights = camera(size=(40, 56)), [IMAGE, SUN]
    front = replace(scene("corner", made, rng), albedo=np.full((40, 56, 3), 0.5))
    plain, bent = (ssdo(front, lights, bent_normals=b, runtime=runtime) for b in (False, True))
    for one, other in zip(plain, bent[:2], strict=True):
        np.testing.assert_array_equal(one, other)
    assert np.abs(bent[2] - np.asarray(front.normal)).max() > 0.1
    # Where all is open, the normal itself.
    plane = trace(made, [tilted(made, 40.0)])
    _, bounce, found = ssdo(plane, lights, bent_normals=True, runtime=runtime)
    np.testing.assert_allclose(found, np.asarray(plane.normal), atol=1e-6)
    assert not bounce.any()


@pytest.mark.slow
@pytest.mark.parametrize("views", [0, 1])
def test_bent_normals_are_those_of_gtao_if_slices_are_many(runtime: Runtime, corner: GBuffer, views: int) -> None:
    one = front_of(corner)
    many: dict[str, Any] = {"slices": 8, "taps": 32, "blur_radius": 0, "bent_normals": True}
    _, _, bent = ssdo(one, [SKY, SUN], 1.0, auxiliary_views=[one] * views, runtime=runtime, **many)
    _, wanted = gi.gtao(one, 1.0, runtime=runtime, **many)
    np.testing.assert_allclose(np.linalg.norm(bent, axis=-1), 1.0, rtol=1e-5)
    # Horizons hide all below them, pieces what they cover; neither is right at a silhouette.
    assert float(np.sum(bent * wanted, axis=-1).mean()) > 0.999
    assert float(np.sum(bent * one.inner(np.asarray(one.normal)), axis=-1).mean()) < 0.99


def test_the_published_method_reads_no_thickness(runtime: Runtime, corner: GBuffer) -> None:
    plain = front_of(corner)
    thick = replace(plain, thickness=np.full(np.shape(plain.depth), 0.3, np.float32))
    options: dict[str, Any] = {"method": "published", "shadow_taps": 0, "runtime": runtime}
    for views in ([], [thick]):
        expected, found = (ssdo(gbuffer, [SKY, LAMP], auxiliary_views=views, **options) for gbuffer in (plain, thick))
        np.testing.assert_array_equal(found, expected)


def test_lights_shine_as_they_do_in_shading(variant_runtime: Runtime, corner: GBuffer) -> None:
    lights = [LAMP, SUN]
    options: dict[str, Any] = {"runtime": variant_runtime, "shadow_taps": 0}
    direct, _ = ssdo(corner, lights, bounce=False, **options)
    white = replace(corner, albedo=np.ones_like(corner.albedo))
    expected = np.pi * shade(white, lights, runtime=variant_runtime)
    np.testing.assert_allclose(direct, expected, rtol=1e-5, atol=1e-6 * expected.max())
    with_bounce, bounce = ssdo(corner, lights, method="points", **options)
    np.testing.assert_array_equal(direct, with_bounce)
    assert bounce.any()


def test_shadow_maps_dim_direct_light_and_what_it_makes_surfaces_send(runtime: Runtime) -> None:
    made = BUILTIN_SCENES["cornell_box"]()
    punctual_light = made.lights[0]
    assert isinstance(punctual_light, gi.SpotLight)
    gbuffer = gi.rasterize.gbuffer(made.scene, made.camera(64, 48), runtime=runtime)
    dark = replace(gbuffer, emission=None)
    rsm = gi.rasterize.rsm(made.scene, punctual_light, size=128, runtime=runtime)
    options: dict[str, Any] = {"radius": 0.3, "method": "points", "runtime": runtime}
    with_map = ssdo(dark, [punctual_light], shadow_maps=[rsm], **options)
    marched = ssdo(dark, [punctual_light], **options)
    without = ssdo(dark, [punctual_light], shadow_taps=0, **options)
    for by_map, by_march, open_ in zip(with_map, marched, without, strict=True):
        assert (means(by_map) < 0.95 * means(open_)).all()
        assert (means(by_march) < 0.97 * means(open_)).all()
        assert (by_map <= open_ * (1 + 1e-5) + 1e-9).mean() > 0.999  # smoothing rounds


@pytest.mark.parametrize("method", ["bitmask", "points"])
def test_light_adds_up_and_scales(runtime: Runtime, corner: GBuffer, method: str) -> None:
    def both(*lights: Light) -> Floats:
        # Points are chosen for a sky's image: with another sky there are others.
        return np.stack(ssdo(corner, [*lights, IMAGE], runtime=runtime, method=method))

    summed = both(LAMP, SKY)
    np.testing.assert_allclose(
        summed + both(),
        both(LAMP) + both(SKY),
        atol=1e-5 * summed.max(),  # orders of float32 sums
    )
    brighter: list[Light] = [
        PointLight(LAMP.position, 1024.0 * np.asarray(LAMP.intensity)),
        Environment(1024.0 * np.asarray(SKY.radiance)),
        Environment(1023.0 * np.asarray(IMAGE.radiance)),
    ]
    # A power of two: no rounding differs, but in the filtered map of an image.
    np.testing.assert_allclose(both(*brighter), 1024.0 * summed, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("method", PUBLISHED_SLOW)
def test_given_radiance_is_what_surfaces_send(runtime: Runtime, corner: GBuffer, method: str) -> None:
    shape = (*np.shape(corner.depth), 3)
    options: dict[str, Any] = {"runtime": runtime, "method": method}
    direct, dark = ssdo(corner, [LAMP], radiance=np.zeros(shape), **options)
    assert not dark.any()
    _, one = ssdo(corner, [], radiance=np.ones(shape), **options)
    _, red = ssdo(corner, [LAMP], radiance=np.ones(shape) * [1, 0, 0], **options)
    np.testing.assert_array_equal(red[..., 0], one[..., 0])
    assert not red[..., 1:].any()
    assert direct.any()
    # Only the front layer sends.
    _, front = ssdo(corner, [], radiance=np.ones(shape[1:]), **options)
    assert (front <= one + 1e-6).all()
    assert 0.0 < front.mean() <= one.mean()


def test_senders_are_as_open_to_the_sky_as_the_back_end_finds(runtime: Runtime, corner: GBuffer) -> None:
    single = front_of(corner)
    options: dict[str, Any] = {"runtime": runtime, "method": "points", "radius": 0.5, "blur_passes": 0}
    _, bounce = ssdo(single, [SKY], **options)
    device = on_device(single, runtime)
    params = SsdoParams(method="points")
    with runtime.frame():
        coarse = Senders(runtime, params, shape_of(device)).visibility(device).download()[0]
    # Each pixel takes the nearest that was looked at; the margin has the border's.
    index = [
        np.clip((np.arange(-edge, size + edge).clip(0) + 2) // 4, 0, len_ - 1)
        for edge, size, len_ in zip((4, 6), device.size, coarse.shape, strict=True)
    ]
    lit = 0.5 * coarse[np.ix_(*index)][..., None] * np.asarray(SKY.radiance)
    _, expected = ssdo(single, [], radiance=lit, **options)
    np.testing.assert_allclose(bounce, expected, rtol=1e-5, atol=1e-6)


# ---- auxiliary cameras


def box_with_views(runtime: Runtime, count: int) -> tuple[BuiltinScene, GBuffer, list[GBuffer]]:
    """Return the Cornell box, and the G-buffers of its camera and of auxiliary ones."""
    made = BUILTIN_SCENES["cornell_box"]()
    gbuffer = replace(gi.rasterize.gbuffer(made.scene, made.camera(64, 48), runtime=runtime), emission=None)
    extra = gi.auxiliary_cameras(gbuffer.camera, gbuffer, count, size=1.0)
    views = [replace(gi.rasterize.gbuffer(made.scene, each, runtime=runtime), emission=None) for each in extra]
    return made, gbuffer, views


@pytest.mark.parametrize("method", METHODS)
def test_auxiliary_cameras_hide_and_send_more(runtime: Runtime, method: str) -> None:
    made, gbuffer, views = box_with_views(runtime, 2)
    punctual_light = made.lights[0]
    options: dict[str, Any] = {"radius": 1.0, "runtime": runtime, "method": method}
    alone = ssdo(gbuffer, [punctual_light, SKY], **options)
    one, two = (ssdo(gbuffer, [punctual_light, SKY], auxiliary_views=views[:n], **options) for n in (1, 2))
    for fewer, more in ((alone, one), (one, two)):
        assert (means(more[0]) < means(fewer[0])).all(), "less of the sky is seen"
        assert (means(more[1]) > means(fewer[1])).all(), "more surfaces send"
    # A camera that sees nothing of it changes nothing.
    away = gi.Camera.look_at((50, 0, 0), (99, 0, 0), width=32, height=24)
    blind = gi.rasterize.gbuffer(made.scene, away, runtime=runtime)
    for with_it, without in zip(
        ssdo(gbuffer, [punctual_light, SKY], auxiliary_views=[blind], **options), alone, strict=True
    ):
        np.testing.assert_array_equal(with_it, without)


def test_view_taps_are_how_many_depths_are_read_in_how_many_directions() -> None:
    published, finer = (SsdoParams(view_taps=taps).views() for taps in (4, 16))
    assert published == ViewsParams()
    assert finer == replace(published, taps=16, strata=4)


@pytest.mark.slow
def test_more_view_taps_come_closer_to_what_many_find(runtime: Runtime) -> None:
    made, gbuffer, views = box_with_views(runtime, 1)
    few, more, most = (
        ssdo(gbuffer, [made.lights[0]], radius=1.0, auxiliary_views=views, view_taps=taps, runtime=runtime)[1]
        for taps in (4, 16, 64)
    )
    assert np.abs(more - most).mean() < 0.7 * np.abs(few - most).mean()


# ---- skipped passes


def test_without_light_all_is_zero_and_the_reason_is_told(runtime: Runtime, corner: GBuffer) -> None:
    dark: list[Light] = [PointLight((0, 1, 0), 0.0), Environment(0.0)]
    for lights in ([], dark):
        direct, bounce = ssdo(corner, lights, runtime=runtime)
        assert direct.shape == bounce.shape == (*corner.size, 3)
        assert not direct.any()
        assert not bounce.any()
        skipped = {each.name: each.skipped for each in runtime.times()}
        assert skipped["lit layers"] == "no light and no emission"
        assert skipped["ssdo"] == "no ambient light, and nothing that a surface could send"
        assert "ssdo_bitmask" not in skipped


def test_without_bounce_only_the_sky_is_looked_for(runtime: Runtime, corner: GBuffer) -> None:
    # Shadows that are looked for in the image differ by the noise that the blur leaves.
    options: dict[str, Any] = {"runtime": runtime, "method": "points", "shadow_taps": 0}
    direct, bounce = ssdo(corner, [SKY, LAMP], bounce=False, **options)
    assert not bounce.any()
    assert not any("lit layer" in each.name for each in runtime.times())
    expected, _ = ssdo(corner, [SKY, LAMP], **options)
    np.testing.assert_allclose(direct, expected, rtol=1e-5, atol=1e-6)


# ---- shapes


@pytest.mark.parametrize(
    ("resolution", "blur_resolution", "tolerance"),
    [
        ("quarter", "own", 0.3),
        pytest.param("half", "full", 0.15, marks=pytest.mark.slow),
        pytest.param("half", "own", 0.15, marks=pytest.mark.slow),
        pytest.param("quarter", "full", 0.3, marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("method", PUBLISHED_SLOW)
def test_lower_resolutions_find_about_the_same(
    runtime: Runtime, method: str, resolution: str, blur_resolution: str, tolerance: float
) -> None:
    made = BUILTIN_SCENES["cornell_box"]()
    gbuffer = gi.rasterize.gbuffer(made.scene, made.camera(160, 120), runtime=runtime)
    gbuffer = replace(gbuffer, emission=None)
    options: dict[str, Any] = {"radius": 0.1, "runtime": runtime, "method": method}
    lights = [SKY, made.lights[0]]
    found = ssdo(gbuffer, lights, resolution=resolution, blur_resolution=blur_resolution, **options)
    full = ssdo(gbuffer, lights, resolution="full", **options)
    for low, high in zip(found, full, strict=True):
        # The radius is 25 pixels: much of the bounce falls next to edges, of which every second
        # or fourth pixel is looked at. Measured: 9 % and 24 %.
        np.testing.assert_allclose(means(low), means(high), rtol=tolerance)


@pytest.mark.parametrize("method", PUBLISHED_SLOW)
def test_where_nothing_is_there_is_no_light(runtime: Runtime, corner: GBuffer, method: str) -> None:
    gbuffer = replace(corner, depth=np.full_like(corner.depth, np.inf))
    for image in ssdo(gbuffer, [SKY, IMAGE, LAMP], runtime=runtime, method=method):
        assert not image.any()


# ---- wrong arguments

SMALL = GBuffer(camera=camera(size=(5, 7)), depth=np.ones((5, 7)))


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"radius": 0.0}, ValueError, "radius is 0.0.*scene units"),
        ({"radius": "wide"}, TypeError, "radius is 'wide'"),
        ({"method": "rays"}, ValueError, "method is 'rays'"),
        ({"samples": 0}, ValueError, "samples is 0"),
        ({"bounce": 1}, TypeError, "bounce is 1"),
        ({"lights": ["sun"]}, TypeError, r"lights\[0\] is str: expected a light"),
        ({"shadow_maps": []}, ValueError, "shadow_maps has 0 entries: expected 1"),
        ({"radiance": np.ones((3, 3, 3))}, ValueError, r"radiance has shape \(3, 3, 3\)"),
        ({"radiance": -np.ones((5, 7, 3))}, ValueError, r"radiance\[0, 0, 0\] is -1"),
        ({"radiance": np.ones((2, 5, 7, 3))}, ValueError, r"radiance has shape \(2, 5, 7, 3\)"),
        ({"colour": 1}, TypeError, "colour"),
        ({"gbuffer": None}, TypeError, "gbuffer is NoneType"),
        ({"auxiliary_views": [SMALL, "left"]}, TypeError, r"auxiliary_views\[1\] is str: expected GBuffer"),
        ({"view_taps": 65}, ValueError, "view_taps is 65: expected an integer >= 1 and <= 64"),
        (
            {"method": "points", "bent_normals": True},
            ValueError,
            "bent_normals is True with 'points': expected 'bitmask'",
        ),
        ({"strength": 2.0}, ValueError, r"strength=2 applies only to method='published' \(got method='bitmask'\)"),
        (
            {"method": "points", "nearest_distance": 0.5},
            ValueError,
            r"nearest_distance=0.5 applies only to method='published' \(got method='points'\)",
        ),
        (
            {"method": "published", "thickness": 0.25},
            ValueError,
            r"thickness=0.25 applies only to method='bitmask' or 'points' \(got method='published'\)",
        ),
    ],
)
def test_wrong_arguments_are_refused(
    runtime: Runtime, changes: dict[str, Any], error: type[Exception], words: str
) -> None:
    arguments: dict[str, Any] = {"gbuffer": SMALL, "lights": [SUN], **changes}
    with pytest.raises(error, match=words):
        ssdo(**arguments, runtime=runtime)


def test_another_gbuffer_is_refused(runtime: Runtime, corner: GBuffer) -> None:
    device = on_device(corner, runtime)
    with pytest.raises(ValueError, match=r"layers with attributes are \(\(40, 56\).*expected"):
        Ssdo(runtime, device.size, SsdoParams(method="points")).run(device, [SUN])


# ---- parameters of the parts

COUNTS: list[tuple[str, type[Params], str]] = [
    ("slices", SsdoBitmaskParams, "slices"),
    ("taps", SsdoBitmaskParams, "taps"),
    ("samples", PointsParams, "samples"),
    ("blur_radius", BilateralParams, "radius"),
    ("blur_passes", BilateralParams, "passes"),
    ("shadow_taps", LightShadowParams, "taps"),
]
"""Counts of `SsdoParams`, and the parameters of its parts that they become."""


def declared(params: Any) -> dict[str, Any]:
    """Return the declaration of each parameter by name."""
    return {field.name: field.metadata for field in fields(params)}


def ends() -> Iterator[Any]:
    """Yield method, parameter and value at each finite end of what is allowed."""
    for name, rule in declared(SsdoParams).items():
        for method in METHODS_OF.get(name, METHODS):
            for end in ("low", "high"):
                if math.isfinite(rule[end]) and not (end == "low" and rule["above"]):
                    yield pytest.param(method, name, rule[end], id=f"{method}-{name}-{end}")


@pytest.mark.parametrize(("method", "name", "value"), list(ends()))
def test_nothing_that_is_allowed_is_refused_behind(method: str, name: str, value: float) -> None:
    params = SsdoParams(method=method, **{name: value})
    params.back_end((8, 8), (1, 1))
    params.views()
    assert params.blur
    if params.shadow_taps:  # without, no light casts a shadow
        params.punctual_lights()


@pytest.mark.parametrize(("name", "behind", "there"), COUNTS)
def test_counts_go_as_high_as_those_they_become(name: str, behind: type[Params], there: str) -> None:
    assert declared(SsdoParams)[name]["high"] == declared(behind)[there]["high"]
