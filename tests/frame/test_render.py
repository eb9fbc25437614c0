"""Frames of `render`: their arrays, skipped passes, repetition, arguments."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.render import Frame, Renderer
from ssgi_cl.frame.render import render as render_kept
from ssgi_cl.frame.skips import SKIPS
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, BuiltinScene, make_scene
from ssgi_cl.reference.direct.shade import shade_reference
from ssgi_cl.reference.filters.tonemap import encoded_reference
from ssgi_cl.techniques.ao.ssao import SsaoParams
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.filters.tonemap import auto_exposure

from .scenes import MAPS, halves, scene_of

SUN = DirectionalLight((-0.3, -1.0, -0.4), (3.0, 2.8, 2.5))
SKY = Environment((0.4, 0.5, 0.7))
LAMP = PointLight((0.3, 1.2, 0.4), (1.0, 0.8, 0.6))
SPOT = SpotLight((0.2, 1.5, 0.3), (-0.1, -1.0, 0.0), 0.8, 1.0)
LIGHTS: tuple[Light, ...] = (SUN, SKY, LAMP, SPOT)
SLOW = pytest.mark.slow


@pytest.fixture(scope="module")
def small() -> Scene:
    """A floor with a wall on it, of which the wall glows a little."""
    floor = [[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]]
    wall = [[-0.5, 0, -0.2], [0.5, 0, -0.2], [0.5, 0.6, -0.2], [-0.5, 0.6, -0.2]]
    glowing = Material(albedo=(0.6, 0.2, 0.2), emission=(0.02, 0.0, 0.01))
    scene = scene_of(floor + wall, halves([(0, 1, 2, 3), (4, 5, 6, 7)]), Material(), glowing, ids=[0, 0, 1, 1])
    return replace(scene, normals=np.array([[0, 1, 0]] * 4 + [[0, 0, 1]] * 4, np.float32))


def viewer(width: int = 64, height: int = 48) -> Camera:
    """Return a camera that sees floor, wall and sky."""
    return Camera.look_at((1.2, 1.0, 1.8), (0, 0.3, 0), width=width, height=height)


def render(scene: Scene, camera: Camera, lights: Any, **options: Any) -> Frame:
    """Render as a first frame would be: nothing stays from the frames of other tests."""
    return render_kept(scene, camera, lights, **{"skips": set(SKIPS) - {"unchanged"}, **options})


def names(frame: Frame) -> list[str]:
    """Return the names of the passes that ran."""
    return [p.name for p in frame.passes if not p.skipped]


def skipped(frame: Frame) -> dict[str, str]:
    """Return the passes that did not run, and why; not those of which a part was left out."""
    return {p.name: p.skipped for p in frame.passes if p.skipped}


# ---- what a frame holds


def test_frame_holds_arrays_of_the_documented_shape_and_type(runtime: Runtime, small: Scene) -> None:
    frame = render(small, viewer(), LIGHTS, bounces=0, gbuffer=True, shadow_size=128, runtime=runtime)
    assert (frame.image.shape, frame.image.dtype) == ((48, 64, 3), np.uint8)
    assert (frame.radiance.shape, frame.radiance.dtype) == ((48, 64, 3), np.float32)
    assert (frame.ao.shape, frame.ao.dtype) == ((48, 64), np.float32)
    assert frame.gbuffer.size == (48, 64)
    assert frame.exposure > 0.0
    assert frame.wall_ms > 0.0
    assert np.isfinite(frame.radiance).all()
    assert frame.radiance.min() >= 0.0
    assert 0.0 <= frame.ao.min() < 0.9
    assert frame.ao.max() == 1.0
    for array in (frame.image, frame.radiance, frame.ao):
        assert array.flags.c_contiguous
    wanted = ["gbuffer_normals", "bitmask_ao", "shade_light", "shade_combine", "tonemap"]
    first = [names(frame).index(name) for name in wanted]
    assert first == sorted(first)
    assert all(p.ms >= 0.0 and (p.ms == 0.0 or not p.skipped) for p in frame.passes)
    assert sum(p.ms for p in frame.passes) < frame.wall_ms


@pytest.mark.parametrize(
    "name", [name if name in ("cornell_box", "terrace") else pytest.param(name, marks=SLOW) for name in BUILTIN_SCENES]
)
def test_builtin_scene_renders_without_holes(runtime: Runtime, name: str) -> None:
    built = BUILTIN_SCENES[name]()
    given: dict[str, Any] = {"ao_radius": built.ao_radius, "shadow_size": 64, "runtime": runtime}
    frame = render(built.scene, built.camera(64, 48), built.lights, bounces=0, **given)
    assert np.isfinite(frame.radiance).all()
    assert frame.radiance.min() >= 0.0
    lit = (frame.radiance > 0.0).any(axis=-1)
    # The Cornell box is closed, dark where only bounced light would reach; others have a sky.
    assert lit.mean() > 0.15
    assert frame.image.std() > 10.0


def test_radiance_is_that_of_the_float64_references_of_the_frames_own_inputs(runtime: Runtime, small: Scene) -> None:
    camera = viewer()
    frame = render(small, camera, LIGHTS, bounces=0, gbuffer=True, shadow_size=512, runtime=runtime)
    assert frame.ao is not None
    rsms = [
        None if isinstance(light, Environment) else gi.rasterize.rsm(small, light, size=512, runtime=runtime)
        for light in LIGHTS
    ]
    expected = shade_reference(frame.gbuffer, LIGHTS, shadow_maps=rsms, ao=frame.ao)
    wrong = ~(np.abs(frame.radiance - expected) <= 1e-5 * expected.max())
    # Fitted maps have other texels than whole ones. A texel at the limit of a shadow, or a point at
    # the edge of the cone: 1 of 3072 pixels.
    assert wrong.any(axis=-1).mean() < 2e-3
    image = encoded_reference(frame.radiance, frame.exposure)
    assert np.abs(frame.image - image).max() <= 0.5 + 1e-3  # rounded to whole values


def test_gbuffer_is_that_of_the_rasteriser(runtime: Runtime, small: Scene) -> None:
    frame = render(small, viewer(), [SKY], bounces=0, gbuffer=True, layers=2, overscan=0.1, runtime=runtime)
    expected = gi.rasterize.gbuffer(small, viewer(), layers=2, overscan=0.1, runtime=runtime)
    assert frame.gbuffer.layers == 2
    assert frame.gbuffer.margin == (5, 7)
    for name in ("depth", "normal", "albedo", "emission"):
        np.testing.assert_array_equal(getattr(frame.gbuffer, name), getattr(expected, name))


def test_layers_and_overscan_do_not_change_what_they_do_not_concern(runtime: Runtime, small: Scene) -> None:
    plain = render(small, viewer(), [SUN, LAMP], bounces=0, shadow_size=128, runtime=runtime)
    more = render(small, viewer(), [SUN, LAMP], bounces=0, shadow_size=128, layers=2, overscan=0.2, runtime=runtime)
    # The margin moves the origin of pixel positions, which round by 2^-24.
    wrong = np.abs(plain.radiance - more.radiance) > 1e-5 * plain.radiance.max()
    assert wrong.mean() < 2e-3  # edges of triangles and shadows


# ---- what a frame leaves out


def test_ao_is_skipped_with_a_reason_where_there_is_no_ambient_light(runtime: Runtime, small: Scene) -> None:
    for lights in ([SUN], [SUN, Environment(0.0)], []):
        frame = render(small, viewer(), lights, bounces=0, shadow_size=64, runtime=runtime)
        assert frame.ao is None
        assert skipped(frame)["bitmask_ao"] == "no ambient light for it to dim"
        assert "bitmask_ao" not in names(frame)


def test_ao_is_left_out_if_not_asked_for(runtime: Runtime, small: Scene) -> None:
    frame = render(small, viewer(), [SUN, SKY], bounces=0, ao=False, shadow_size=64, runtime=runtime)
    assert frame.ao is None
    assert frame.gbuffer is None
    assert not {"ssao", "bitmask_ao"} & {p.name for p in frame.passes}
    given: dict[str, Any] = {"bounces": 0, "shadow_size": 64, "runtime": runtime}
    skipped, none = (render(small, viewer(), [SUN], ao=ao, **given).radiance for ao in (True, False))
    np.testing.assert_array_equal(skipped, none)


def test_light_that_emits_nothing_draws_no_shadow_map(runtime: Runtime, small: Scene) -> None:
    dark = PointLight((0, 1, 0), 0.0)
    options: dict[str, Any] = {"shadow_size": 64, "skips": ("dark", "maps"), "runtime": runtime}
    none = render(small, viewer(), [SKY], bounces=0, **options)
    frame = render(small, viewer(), [dark, SKY], bounces=0, **options)
    assert skipped(frame) == {"light point": "it emits nothing"}
    assert names(frame) == names(none)
    np.testing.assert_array_equal(frame.radiance, none.radiance)


def test_no_light_leaves_what_glows_by_itself(runtime: Runtime, small: Scene) -> None:
    frame = render(small, viewer(), [], bounces=0, gbuffer=True, runtime=runtime)
    np.testing.assert_array_equal(frame.radiance, np.asarray(frame.gbuffer.emission))
    assert frame.radiance.any()


# ---- ambient occlusion by each technique, and indirect light


def test_the_default_knows_where_solids_end_and_scans_every_other_pixel(runtime: Runtime) -> None:
    built = make_scene("room-7")
    camera = built.camera(80, 60)
    given: dict[str, Any] = {"bounces": 0, "ao_radius": built.ao_radius, "outputs": ["ao"], "runtime": runtime}
    frame = render(built.scene, camera, [SKY], **given, gbuffer=True)
    drawn = gi.rasterize.gbuffer(built.scene, camera, thickness=True, runtime=runtime)
    np.testing.assert_array_equal(frame.gbuffer.thickness, drawn.thickness)
    scan: dict[str, Any] = {"checkerboard": True, "blur_radius": 3, "taps": 16}
    by_hand = gi.bitmask_ao(frame.gbuffer, radius=built.ao_radius, **scan, runtime=runtime)
    # Normals of a G-buffer from the host are turned to the view anew: a tap here and there moves by a pixel.
    assert np.mean(np.abs(frame.ao - by_hand) > 1e-3) < 1e-3
    alone = render(built.scene, camera, [SKY], **given)
    np.testing.assert_array_equal(alone.ao, frame.ao)
    without = gi.rasterize.gbuffer(built.scene, camera, runtime=runtime)
    guessed = gi.bitmask_ao(without, radius=built.ao_radius, **scan, runtime=runtime)
    assert np.mean(np.abs(frame.ao - guessed) > 1e-2) > 0.05  # it makes a difference


def test_ends_of_solids_are_drawn_where_occlusion_is_computed_alone(runtime: Runtime) -> None:
    solid, sheet = make_scene("room-7"), make_scene("cornell_box")  # whose boxes have no bottom

    def drawn(built: BuiltinScene, lights: list[Any], **more: Any) -> bool:
        given = {"bounces": 0, "ao_radius": 0.2, "shadow_size": 32, "runtime": runtime, **more}
        return "raster_thickness" in names(render(built.scene, built.camera(48, 36), lights, **given))

    assert drawn(solid, [SKY])
    assert not drawn(solid, [SUN])
    assert not drawn(solid, [SKY], ao="gtao")
    assert not drawn(sheet, [SKY])


def test_ends_of_solids_come_and_go_with_what_reads_them(runtime: Runtime) -> None:
    corners = [[x, y, z] for x in (-0.5, 0.5) for y in (0.0, 1.0) for z in (-0.5, 0.5)]
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    floor = [[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]]
    scene = scene_of(corners + floor, halves([*sides, (8, 9, 10, 11)]), Material())  # in the middle of nothing
    given: dict[str, Any] = {"bounces": 0, "ao_radius": 0.4, "shadow_size": 32, "exposure": 1.0}
    cameras = [Camera.look_at((x, 1.0, 4.0), (x, 0.0, 0.0), yfov=1.0, width=96, height=72) for x in (0.0, -3.5, 3.5)]
    renderer = Renderer(runtime, (72, 96), FrameParams(**given))
    for camera, lights, output in zip((*cameras, cameras[0]), ([SKY], [SUN], [SKY], [SKY]), (0, 0, 1, 0), strict=True):
        more: dict[str, Any] = {"gbuffer": bool(output)}
        kept = renderer(scene, camera, lights, **more)
        anew = render(scene, camera, lights, **given, **more, skips=["dark"], runtime=runtime)
        np.testing.assert_array_equal(kept.radiance, anew.radiance)
        if output:  # what earlier frames left beyond what is seen would show here
            np.testing.assert_array_equal(kept.gbuffer.thickness, anew.gbuffer.thickness)
            assert (np.asarray(kept.gbuffer.thickness) > 0.0).any()


@pytest.mark.parametrize(
    "name", ["ssao", pytest.param("hbao", marks=SLOW), "gtao", pytest.param("bitmask_ao", marks=SLOW)]
)
def test_ao_is_that_of_the_technique_with_the_gbuffers_layers_and_margin(
    runtime: Runtime, small: Scene, name: str
) -> None:
    frame = render(
        small, viewer(), [SKY], bounces=0, ao=name, ao_radius=0.3, layers=2, overscan=0.1, gbuffer=True, runtime=runtime
    )
    by_hand = TECHNIQUES[name].function(frame.gbuffer, radius=0.3, runtime=runtime)
    np.testing.assert_array_equal(frame.ao, by_hand)
    assert frame.ao.min() < 0.9
    assert name in names(frame)


def box(runtime: Runtime, **options: Any) -> Frame:
    """Return a small picture of the Cornell box, lit by its light alone."""
    built = BUILTIN_SCENES["cornell_box"]()
    given = {"shadow_size": 128, "exposure": 1.0, "runtime": runtime, **options}
    return render(built.scene, built.camera(64, 48), built.lights, bounces=0, **given)


@pytest.mark.parametrize(
    "options", [{"indirect": True}, {"indirect": "vpl", "layers": 2}, {"indirect": "gather"}], ids=str
)
def test_indirect_light_brightens_what_the_light_does_not_reach(
    variant_runtime: Runtime, options: dict[str, Any]
) -> None:
    direct = box(variant_runtime, layers=options.get("layers", 1))
    frame = box(variant_runtime, gbuffer=True, **options)
    assert direct.indirect is None
    dark = np.isfinite(frame.gbuffer.first("depth")) & ~direct.radiance.any(axis=-1)
    assert dark.mean() > 0.1
    assert (frame.radiance[dark].max(axis=-1) > 0.0).mean() > 0.9
    # What is added is albedo / pi times the irradiance, and nothing else; float32 roundings.
    added = np.asarray(frame.gbuffer.albedo) / math.pi * frame.indirect
    np.testing.assert_allclose(frame.radiance, direct.radiance + added, rtol=1e-5, atol=1e-6 * frame.radiance.max())


@pytest.mark.parametrize("layers", [1, 2])
def test_indirect_light_is_that_of_vpls_shot_by_hand(runtime: Runtime, layers: int) -> None:
    frame = box(runtime, indirect="vpl", vpls=300, layers=layers, gbuffer=True)
    built = BUILTIN_SCENES["cornell_box"]()
    seen = gi.rasterize.rsm(built.scene, built.lights[0], size=128, runtime=runtime)
    options: dict[str, Any] = {"interleave": True, "visibility": True, "scene": built.scene, "runtime": runtime}
    by_hand = gi.vpl_splat(frame.gbuffer, seen, 300, 0.0, **options)
    # Maps drawn on the device and uploaded ones differ by roundings of float32.
    assert frame.indirect.mean(dtype=float) == pytest.approx(by_hand.mean(dtype=float), rel=1e-5)


@pytest.mark.parametrize(("layers", "overscan"), [pytest.param(1, 0.0, marks=pytest.mark.slow), (2, 0.1)])
def test_near_light_is_that_of_ssdo_by_hand(runtime: Runtime, layers: int, overscan: float) -> None:
    built = BUILTIN_SCENES["cornell_box"]()
    lights = [*built.lights, SKY]
    given: dict[str, Any] = {"indirect": "ssdo", "ao_radius": 0.1, "layers": layers, "overscan": overscan}
    given |= {"shadow_size": 128, "gbuffer": True, "runtime": runtime}
    frame = render(built.scene, built.camera(64, 48), lights, **given)
    assert frame.ao is None
    assert skipped(frame)["ambient occlusion"] == "ssdo hides ambient light by itself"
    rsm = gi.rasterize.rsm(built.scene, built.lights[0], size=128, runtime=runtime)
    direct, bounce = gi.ssdo(
        frame.gbuffer, lights, 0.1, shadow_maps=[rsm, None], resolution="half", emission=False, runtime=runtime
    )
    # Maps drawn on the device and uploaded ones differ by roundings of float32.
    assert frame.indirect.mean(dtype=float) == pytest.approx(bounce.mean(dtype=float), rel=1e-4)
    inner = {n: frame.gbuffer.inner(frame.gbuffer.first(n)) for n in ("albedo", "emission")}
    radiance = inner["albedo"] / math.pi * (direct + bounce) + inner["emission"]
    there = np.isfinite(frame.gbuffer.inner(frame.gbuffer.first("depth")))
    assert 0.1 < there.mean() < 1.0
    wrong = np.abs(frame.radiance - radiance)[there] > 1e-4 * radiance.max()
    assert wrong.mean() < 0.01  # pixels at the edge of a shadow's texel
    sky = np.broadcast_to(np.asarray(SKY.radiance, np.float32), frame.radiance.shape)
    np.testing.assert_array_equal(frame.radiance[~there], sky[~there])


def test_auxiliary_cameras_show_ssdo_more_that_sends_light(runtime: Runtime) -> None:
    few, more, again = (box(runtime, indirect="ssdo", ao_radius=0.5, auxiliary_cameras=count) for count in (0, 2, 2))
    assert more.indirect.mean() > 1.005 * few.indirect.mean()
    assert names(more).count("ssdo_views") == 2
    np.testing.assert_array_equal(more.radiance, again.radiance)


def test_indirect_light_of_several_lights_is_the_sum_of_theirs(runtime: Runtime, small: Scene) -> None:
    def bounced(lights: list[Light], way: str) -> float:
        frame = render(small, viewer(), lights, indirect=way, vpls=4096, runtime=runtime, **MAPS)
        return float(frame.indirect.mean(dtype=float))

    # The samples are shared among the lights: measured 1.6 % (vpl, whose lights share shadow rays)
    # and 5.0 % (gather).
    for way, share in (("multires", 0.03), ("vpl", 0.035), ("gather", 0.06)):
        alone = sum(bounced([punctual_light], way) for punctual_light in (SUN, LAMP, SPOT))
        assert bounced([SUN, SKY, LAMP, SPOT], way) == pytest.approx(alone, rel=share)


def test_no_light_reflects_nothing_and_says_so(runtime: Runtime, small: Scene) -> None:
    plain = render(small, viewer(), [SKY], bounces=0, runtime=runtime)
    ways = {"multires": "multires splat", "vpl": "vpl splat", "gather": "rsm gather"}
    for way, name in ways.items():
        frame = render(small, viewer(), [SKY], indirect=way, runtime=runtime)
        assert frame.indirect is None
        assert skipped(frame) == {name: "no light that a map could be made of"}
        assert names(frame) == names(plain)
        np.testing.assert_array_equal(frame.radiance, plain.radiance)


@pytest.mark.parametrize("way", ["multires", "vpl"])
def test_all_triangles_block_reflected_light_whatever_layers_there_are(runtime: Runtime, way: str) -> None:
    one, two = (box(runtime, indirect=way, layers=layers, gbuffer=True) for layers in (1, 2))
    built = BUILTIN_SCENES["cornell_box"]()
    seen = gi.rasterize.rsm(built.scene, built.lights[0], size=128, runtime=runtime)
    free = gi.vpl_splat(one.gbuffer, seen, 1024, 0.0, runtime=runtime)
    np.testing.assert_array_equal(one.indirect, two.indirect)
    # Light that walls let through is 15 to 19 % more, by paths too.
    assert 0.78 < one.indirect.mean() / free.mean() < 0.92
    for frame in (one, two):
        assert (frame.levels is None) == (way == "vpl")
        if frame.levels is not None:
            assert frame.levels.shape == (48, 64)
            assert set(np.unique(frame.levels)) <= {0, 1, 2, 4, 8, 16, 32}
            assert frame.levels.any()


@pytest.mark.parametrize("way", ["multires", "vpl", "gather"])
def test_a_light_that_lights_nothing_leaves_the_light_of_the_others(runtime: Runtime, small: Scene, way: str) -> None:
    away = SpotLight((0.2, 1.5, 0.3), (0.0, 1.0, 0.0), 0.3, 1.0)
    options: dict[str, Any] = {"indirect": way, "shadow_size": 64, "runtime": runtime}
    alone = render(small, viewer(), [LAMP], bounces=0, **options)
    both = render(small, viewer(), [LAMP, away], bounces=0, **options)
    assert alone.indirect is not None
    assert skipped(both)["bounce spot"] == "it lights nothing that reflects"
    np.testing.assert_array_equal(alone.indirect, both.indirect)
    nothing = render(small, viewer(), [away], bounces=0, **options)
    assert nothing.indirect is None
    assert not any(name.startswith(("vpl", "multires", "rsm gather")) for name in names(nothing))


# ---- repeating


@pytest.mark.parametrize(
    "options", [{}, {"indirect": "multires"}, {"indirect": "vpl", "layers": 2}, {"indirect": "gather"}], ids=str
)
def test_frames_repeat_and_allocate_nothing(runtime: Runtime, small: Scene, options: dict[str, Any]) -> None:
    given = {"shadow_size": 64, "gbuffer": True, "runtime": runtime, **options}
    first = render(small, viewer(), LIGHTS, bounces=0, **given)
    before = runtime.allocated_bytes, runtime.builds
    again = render(small, viewer(), LIGHTS, bounces=0, **given)
    assert (runtime.allocated_bytes, runtime.builds) == before
    assert (first.indirect is not None) == bool(options)
    for name in ("image", "radiance", "ao", "indirect"):
        np.testing.assert_array_equal(getattr(again, name), getattr(first, name))
    assert again.exposure == first.exposure


def test_steady_frames_allocate_no_device_memory_and_compile_nothing(runtime: Runtime, small: Scene) -> None:
    renderer = Renderer(
        runtime, (48, 64), FrameParams(bounces=0, ao=SsaoParams(radius=0.3), shadow_size=128, layers=2, overscan=0.0625)
    )
    first = renderer(small, viewer(), LIGHTS)
    before = runtime.allocated_bytes, runtime.builds
    for step in range(3):
        moved = Camera.look_at((1.2 - 0.1 * step, 1, 1.8), (0, 0.3, 0), width=64, height=48)
        frame = renderer(small, moved, LIGHTS)
        if step == 0:
            np.testing.assert_array_equal(frame.image, first.image)
    assert (runtime.allocated_bytes, runtime.builds) == before


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (3, 2), (5, 3), (17, 31), (31, 17)], ids=str)
def test_odd_sizes(variant_runtime: Runtime, small: Scene, size: tuple[int, int]) -> None:
    frame = render(
        small, viewer(size[1], size[0]), LIGHTS, bounces=0, shadow_size=64, overscan=0.3, runtime=variant_runtime
    )
    assert frame.image.shape == (*size, 3)
    assert np.isfinite(frame.radiance).all()
    assert frame.exposure == auto_exposure(frame.radiance)


def test_far_from_the_origin_the_picture_is_the_same(runtime: Runtime, small: Scene) -> None:
    shift = np.array([1e6, -2e6, 5e5])
    moved = replace(small, origin=shift)
    lights: list[Light] = [
        SUN,
        SKY,
        PointLight(np.asarray(LAMP.position) + shift, LAMP.intensity),
        SpotLight(np.asarray(SPOT.position) + shift, SPOT.direction, 0.8, SPOT.intensity),
    ]
    camera = Camera.look_at(np.add(shift, (1.2, 1.0, 1.8)), np.add(shift, (0, 0.3, 0)), width=64, height=48)
    a = render(small, viewer(), LIGHTS, bounces=0, shadow_size=128, runtime=runtime)
    b = render(moved, camera, lights, bounces=0, shadow_size=128, runtime=runtime)
    # Positions of 1e6 in float64 round by 1e-10: edges may fall to the next pixel or texel.
    assert np.mean(np.abs(a.image.astype(int) - b.image).max(axis=-1) > 1) < 5e-3


# ---- exposure and curve


def test_exposure_and_curve_are_those_given(runtime: Runtime, small: Scene) -> None:
    for curve in ("clip", "filmic"):
        frame = render(small, viewer(), [SUN], bounces=0, exposure=0.5, curve=curve, shadow_size=64, runtime=runtime)
        assert frame.exposure == 0.5
        expected = encoded_reference(frame.radiance, 0.5, curve)
        assert np.abs(frame.image - expected).max() <= 0.5 + 1e-3  # rounded to whole values


@pytest.mark.parametrize("power", [1e-6, 1e6])
def test_automatic_exposure_undoes_the_brightness_of_the_light(runtime: Runtime, small: Scene, power: float) -> None:
    dull = replace(small, material_ids=np.zeros(4, np.int32))

    def lit(factor: float) -> Frame:
        lights = [DirectionalLight(SUN.direction, factor), Environment(factor * np.asarray(SKY.radiance))]
        return render(dull, viewer(), lights, bounces=0, shadow_size=64, runtime=runtime)

    a, b = lit(1.0), lit(power)
    assert np.abs(a.image.astype(int) - b.image).max() <= 1  # a value may round to the next


@pytest.mark.parametrize(("sun", "bounces"), [(False, "all"), (True, "all"), (True, 0)])
def test_few_surfaces_are_white_where_most_are_dark(runtime: Runtime, sun: bool, bounces: Any) -> None:
    place = BUILTIN_SCENES["terrace"]()
    eye, target = np.array(place.eye), np.array(place.target)
    points = target + 0.3 * (eye - target) + (0.0, 0.4, 0.0), 0.5 * (eye + target) + (1.0, 0.6, 0.0)
    lights = [SUN] if sun else [PointLight(tuple(point), 1.0) for point in points]
    frame = render(place.scene, place.camera(160, 120), lights, bounces=bounces, gbuffer=True, runtime=runtime)
    assert frame.gbuffer is not None
    seen = np.isfinite(np.asarray(frame.gbuffer.depth))
    # By the log-average of all pixels 6 % would be, with the two lights.
    assert np.mean((frame.image[seen] >= 250).all(axis=-1)) <= 0.05
    # Nor is it dark: half of what is lit at all is above a tenth of the scale.
    assert np.median(frame.image[seen].max(axis=-1)[frame.radiance[seen].max(axis=-1) > 0.0]) > 25


# ---- bad input


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"scene": "room.glb"}, TypeError, r"scene is str: expected a Scene"),
        ({"camera": None}, TypeError, r"camera is None: expected an ssgi_cl.Camera"),
        ({"lights": [None]}, TypeError, r"lights\[0\] is NoneType: expected a light"),
        ({"layers": 0}, ValueError, r"layers is 0: expected an integer >= 1 and <= 16"),
        ({"overscan": -0.1}, ValueError, r"overscan is -0.1: expected a number >= 0"),
        ({"shadow_size": 8}, ValueError, r"shadow_size is 8: expected an integer >= 16.*texels"),
        ({"rsm_size": 8}, ValueError, r"rsm_size is 8: expected an integer >= 16.*texels"),
        ({"exposure": 0}, ValueError, r"exposure is 0: expected a number > 0"),
        ({"curve": "log"}, ValueError, r"curve is 'log': expected one of 'clip', 'filmic'"),
        ({"ao_radius": -1.0}, ValueError, r"radius is -1.0: expected a number > 0.*scene units"),
        ({"ao": "ssao", "ao_samples": 0}, ValueError, r"samples is 0: expected an integer >= 1"),
        ({"ao_samples": 8}, ValueError, r"ao_samples is 8: expected None with ao=True"),
        ({"ao": "yes"}, ValueError, r"ao is 'yes': expected one of 'ssao', 'hbao'"),
        ({"ao": None}, TypeError, r"ao is None: expected True, False or the name"),
        ({"indirect": "rays"}, ValueError, r"indirect is 'rays': expected one of 'multires', "),
        ({"indirect": 1}, TypeError, r"indirect is 1: expected True, False, None or the name"),
        ({"auxiliary_cameras": 4}, ValueError, r"auxiliary_cameras is 4: expected 0 with "),
        ({"indirect": "vpl", "vpls": 0}, ValueError, r"vpls is 0: expected an integer >= 1"),
        ({"gbuffer": None}, TypeError, r"gbuffer is None: expected True or False"),
        ({"indirect": "ssdo", "multi_bounce": True}, ValueError, r"multi_bounce is True: expected False with ind"),
    ],
    ids=str,
)
def test_bad_argument_is_refused_with_its_name_and_what_is_allowed(
    runtime: Runtime, small: Scene, arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    given: dict[str, Any] = {"scene": small, "camera": viewer(8, 6), "lights": [SKY], "runtime": runtime, **arguments}
    with pytest.raises(error, match=message):
        render(given.pop("scene"), given.pop("camera"), given.pop("lights"), bounces=0, **given)


def test_camera_of_another_size_than_prepared_is_refused(runtime: Runtime, small: Scene) -> None:
    renderer = Renderer(runtime, (6, 8))
    with pytest.raises(ValueError, match=r"\(6, 8\)"):
        renderer(small, viewer(9, 6), [SKY])
