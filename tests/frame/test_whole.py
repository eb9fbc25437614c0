"""The whole picture: all bounces, the sky's visibility, emission; compared with paths and furnaces."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.bench.drawn import polished, with_holes
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams, cell_size
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.techniques.occupancy import scene_rays
from ssgi_cl.techniques.sampled_lights.sampled_lights import SampledLights, SampledLightsParams
from ssgi_cl.techniques.sampled_lights.sampled_maps import SampledMaps
from ssgi_cl.techniques.sky_rays import enclosed

from .scenes import MAPS, cube, halves, inside, matt, scene_of

Floats = NDArray[np.float32]

SKY = gi.Environment((0.4, 0.6, 1.0))


def radiance(scene: Scene, camera: gi.Camera, lights: Any, runtime: Runtime, **given: Any) -> Floats:
    options = {"outputs": ["radiance"], "shadow_size": 256, "rsm_size": 64, "preset": "medium", "ao": False, **given}
    if options.get("bounces") == 0:
        del options["preset"]
    return gi.render(scene, camera, lights, runtime=runtime, **options).radiance


def test_cells_of_the_occupancy_grid() -> None:
    assert cell_size(cube(0.5, 0.0)) == pytest.approx(2.0 / 122.0)


def test_each_bounce_adds_its_share(runtime: Runtime) -> None:
    # L (1 + rho + rho^2 + ...): what is seen itself, what lights it, and each bounce. Without
    # bounces, emission is seen and lights nothing.
    for rho, bounces, expected in (
        (0.5, 0, 1.0),
        (0.5, 1, 1.75),
        (0.5, 4, 1.96875),
        (0.5, "all", 2.0),
        (0.8, "all", 5.0),
    ):
        found = radiance(cube(rho, 1.0), inside(40, 30), [], runtime, bounces=bounces)
        assert found.mean() == pytest.approx(expected, rel=0.02), (rho, bounces)


def quarters(found: Floats) -> Floats:
    """Return the means of the picture's quarters, from left to right; what is brighter than 1 counts as 1."""
    return np.asarray(np.minimum(found, 1.0).reshape(60, 4, 20, 3).mean(axis=(0, 2, 3)))


BOX_PATHS = np.array([0.0221, 0.0826, 0.0794, 0.0164])
"""Quarters of the Cornell box by 256 paths per pixel."""


def test_the_default_frame_is_as_bright_as_paths_find(runtime: Runtime) -> None:
    built = make_scene("cornell_box")
    found = quarters(radiance(built.scene, built.camera(80, 60), built.own_lights, runtime, ao=True, preset="high"))
    # The occupancy grid leaks and hides up to 14 % of a quarter. Direct light alone has 8 %.
    np.testing.assert_allclose(found, BOX_PATHS, rtol=0.16)
    assert found.mean() == pytest.approx(BOX_PATHS.mean(), rel=0.12)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["cornell_box", "parlour"])
def test_the_default_frame_is_near_a_path_tracer(runtime: Runtime, name: str) -> None:
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    built = make_scene(name)
    camera, lights = built.camera(80, 60), built.own_lights
    whole = radiance(built.scene, camera, lights, runtime, ao=True, preset="high")
    crude = radiance(built.scene, camera, lights, runtime, bounces=0)
    paths = gi.truth.radiance(built.scene, camera, lights, paths=64).mean
    if name == "cornell_box":
        more = gi.truth.radiance(built.scene, camera, lights, paths=256, box_filter=True).mean
        np.testing.assert_allclose(quarters(more), BOX_PATHS, rtol=0.02)
    # The light of the box shines on the ceiling behind it too, through a gap narrower than a cell.
    whole, crude, paths = (np.minimum(plane, 1.0) for plane in (whole, crude, paths))

    def bias(found: Floats) -> float:
        return abs(float(found.mean() / paths.mean()) - 1.0)

    def error(found: Floats) -> float:
        # Means of 5 x 5 pixels: the noise of 64 paths would be most of a pixel's error.
        blocks = [a.reshape(12, 5, 16, 5, 3).mean(axis=(1, 3)) for a in (found, paths)]
        return float(np.mean((blocks[0] - blocks[1]) ** 2 / (blocks[1] + 0.05) ** 2))

    # The mean is off by what the occupancy grid leaks and hides, up to 10 % in the parlour;
    # without light of surfaces the box is black.
    assert bias(whole) < 0.12
    assert error(whole) < 0.5 * error(crude)


def test_the_sky_is_hidden_at_any_distance(runtime: Runtime) -> None:
    # Through the one open side of a black cube; the radius of ambient occlusion is 3 % of it.
    scene, camera = cube(0.5, 0.0, sides=5), inside(80, 60)
    seen = radiance(scene, camera, [SKY], runtime, ao=True, bounces=1)
    ambient = radiance(scene, camera, [SKY], runtime, ao=True, bounces=0, ao_radius=0.06)
    direct = 0.0627  # by `truth.direct_light` with 1024 paths
    assert seen.mean() < 0.6 * ambient.mean()
    # One bounce adds at most the albedo's share of what arrives.
    assert direct < 1.05 * seen.mean()
    assert seen.mean() < 1.6 * direct


@pytest.mark.parametrize("bounces", [1, "all"])
def test_rays_find_the_first_bounce_in_scenes_of_many_triangles(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch, bounces: int | str
) -> None:
    """In a closed room it has the flux that virtual point lights carry: pi E = albedo times what the light sends."""
    lights = (gi.SpotLight((0.0, 0.0, 0.9), (0.0, 0.0, -1.0), 1.0, 3.0),)
    given: dict[str, Any] = {"preset": "high", "outputs": ["indirect"], "bounces": bounces, "runtime": runtime}
    frames = []
    for most in (scene_rays.MOST_TRIANGLES, 1):
        monkeypatch.setattr(scene_rays, "MOST_TRIANGLES", most)
        frames.append(gi.render(replace(cube(0.5)), inside(64, 48), lights, **given))
    lit, found = (np.asarray(frame.indirect).astype(np.float64) for frame in frames)
    names = [{entry.name for entry in frame.passes if not entry.skipped} for frame in frames]
    # Virtual point lights are chosen on the device; bright surfels alone are moved to the view. With all bounces none
    # sends four times the mean.
    assert ["vpl_to_view" in ran for ran in names] == [False, bounces == 1]
    # What rays find is blurred, and nothing else.
    assert (
        ["bilateral_blur" in ran for ran in names]
        == ["final_gather" in ran for ran in names]
        == [bounces == "all", True]
    )
    # Of light that is alike in 64 x 48 pixels; the volume's cells are 1/32 of the room.
    assert found.mean() == pytest.approx(lit.mean(), rel=0.03)
    assert np.abs(found - lit).mean() < 0.06 * lit.mean()


@pytest.mark.parametrize("kind", ["enclosed", "open", "holes"])
def test_radiance_is_the_sum_of_its_parts_dimmed_by_contacts_within_two_cells(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    """Albedo / pi (E_sky + E_bounces) where rays find all blockers. With depth maps, the sky is dimmed by A of two
    cells of the occupancy grid; of scenes with holes, where rays go through it, bounces are by min(2 A, 1)."""
    holes = kind == "holes"
    if kind == "enclosed":
        monkeypatch.setattr(enclosed, "OPEN", 0.25)
    scene = cube(0.5, 0.0, sides=5)
    if holes:
        scene = with_holes(scene)
    camera = gi.Camera.look_at((-0.7, -0.7, 0.2), (-1.0, -1.0, 0.0), yfov=0.5, width=64, height=48)  # of an edge
    whole = FrameParams(preset="medium").whole
    assert whole is not None
    given: dict[str, Any] = {
        "preset": "medium",
        "outputs": ["radiance", "ao", "indirect"],
        "edges": 0,
        "runtime": runtime,
    }
    frame = gi.render(scene, camera, [SKY], **given)
    why = [entry.skipped for entry in frame.passes if entry.name == "rays against triangles"]
    assert why == (
        ["a texture's alpha cuts holes into the scene: rays of bounces go through the occupancy grid"] if holes else []
    )
    assert frame.ao is not None
    assert frame.indirect is not None
    gbuffer = gi.rasterize.gbuffer(scene, camera, runtime=runtime)
    a = frame.ao[..., None]
    if kind == "enclosed":
        sky = gi.sky_rays(gbuffer, [SKY], scene=scene, runtime=runtime)
        dimmed = sky + frame.indirect
    else:
        params = SampledLightsParams(directions=whole.directions, map_size=whole.map_size)
        technique = SampledLights(runtime, gbuffer.size, params)
        with runtime.frame():
            seen = None if holes else enclosed.openness(scene, runtime).seen
            maps = SampledMaps(runtime, params.count, params.map_size).draw(scene, [SKY], seen)
            light = technique.run(on_device(gbuffer, runtime), [SKY], scene=scene, maps=maps)
            assert light is not None
            sky = np.moveaxis(light.download(), 0, -1)
        dimmed = a * sky + (np.minimum(2.0 * a, 1.0) if holes else 1.0) * frame.indirect
    there = np.isfinite(np.asarray(gbuffer.depth)) & (sky.max(axis=-1) > 0.0)
    expected = 0.5 / math.pi * dimmed
    assert there.mean() > 0.5
    assert np.quantile(frame.ao[there], 0.05) < 0.8  # there is something that it dims
    np.testing.assert_allclose(frame.radiance[there], expected[there], rtol=1e-4)
    radius = 2.0 * cell_size(scene)
    np.testing.assert_array_equal(frame.ao, gi.render(scene, camera, [SKY], ao_radius=radius, **given).ao)
    np.testing.assert_array_equal(frame.ao, gi.gtao(gbuffer, radius=radius, runtime=runtime))


def test_scene_light_is_kept_while_only_the_camera_moves(runtime: Runtime) -> None:
    built = make_scene("cornell_box")
    given: dict[str, Any] = {"preset": "low", "exposure": 1.0, "runtime": runtime, **MAPS}
    first = built.camera(64, 48)
    moved = gi.Camera.look_at(
        np.add(first.position, (0.01, 0.0, 0.0)), built.target, built.up, yfov=built.yfov, width=64, height=48
    )
    gi.render(built.scene, first, built.lights, **given)
    frame = gi.render(built.scene, moved, built.lights, **given)
    states = {stage.name: stage.state for stage in frame.graph.stages}
    assert states["radiosity"] == "reused"
    assert states["bounce"] == "ran"
    # No environment: its stage costs nothing, and says why.
    assert states["sky light"] == "idle"
    skipped = {entry.name: entry.skipped for entry in frame.passes if entry.skipped}
    assert "no environment shines" in skipped["sky light"]


def test_light_far_beyond_the_range_of_pictures_stays_finite(runtime: Runtime) -> None:
    for scene in (cube(0.5, 1e9), cube(0.0, 0.0), cube(0.9, 1e-9)):
        found = radiance(scene, inside(16, 12), [SKY], runtime, preset="low")
        assert np.isfinite(found).all()


def test_nothing_there_and_no_lights(runtime: Runtime) -> None:
    away = gi.Camera.look_at((0, 0, 5), (0, 0, 9), width=16, height=12)
    found = radiance(cube(0.5, 0.0), away, [SKY], runtime, preset="low")
    np.testing.assert_allclose(found, np.broadcast_to(SKY.radiance, found.shape), rtol=1e-6)
    for lights in ([], [gi.Environment(0.0)]):
        assert not radiance(cube(0.5, 0.0), inside(16, 12), lights, runtime, preset="low").any()


@pytest.mark.slow
def test_glossy_surfaces_mirror_what_paths_find(runtime: Runtime) -> None:
    """The Cornell box with a wall of metal, which shows the boxes and the wall across."""
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    built = make_scene("cornell_box")
    metal = {"albedo": (0.05,) * 3, "specular": (0.8, 0.7, 0.5), "gloss": 60.0}
    materials = tuple(replace(m, **metal) if m.name == "green" else m for m in built.scene.materials)
    scene = replace(built.scene, materials=materials)
    camera = built.camera(64, 48)
    truth = gi.truth.radiance(scene, camera, built.own_lights, 256, box_filter=True).mean
    found = gi.render(scene, camera, built.own_lights, outputs=("radiance",), runtime=runtime).radiance
    assert abs(float(found.mean() / truth.mean()) - 1.0) < 0.06
    drawn = gi.rasterize.gbuffer(scene, camera, runtime=runtime)
    mirrors = (np.asarray(drawn.specular) > 0.0).any(axis=-1)
    assert mirrors.mean() > 0.05
    off = np.abs(found - truth)[mirrors].mean() / truth[mirrors].mean()
    assert off < 0.2


def test_a_white_floor_among_golden_walls_has_the_colour_that_paths_find(runtime: Runtime) -> None:
    """With all of the lobe's light its red would be 2.2 times as much."""
    pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")
    room = cube(0.8, 0.0)
    gold = Material(albedo=(0.0,) * 3, specular=(1.0, 0.77, 0.34), gloss=6.33)
    floor = (room.positions[room.triangles][..., 1] < -0.99).all(axis=1)
    scene = replace(room, materials=(*room.materials, gold), material_ids=np.where(floor, 0, 1).astype(np.int32))
    camera = gi.Camera.look_at((0.5, 0.9, 0.6), (-0.2, -1.0, -0.3), width=48, height=36)
    lights = [gi.PointLight((0.1, 0.3, 0.2), 1.0)]
    seen = np.asarray(gi.rasterize.gbuffer(scene, camera, runtime=runtime).albedo)[..., 0] > 0.5
    truth = gi.truth.radiance(scene, camera, lights, 256).mean
    found = gi.render(scene, camera, lights, outputs=("radiance",), edges=0, runtime=runtime).radiance
    # A lobe's light goes every way, seen from other surfaces, which is not what paths find.
    np.testing.assert_allclose(found[seen].mean(axis=0), truth[seen].mean(axis=0), rtol=0.1)


def test_a_glossy_wall_alone_reflects_sun_and_sky(runtime: Runtime) -> None:
    # No surface sees another, so that there are no surfels.
    wall = scene_of(
        [[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]],
        halves([(0, 1, 2, 3)]),
        Material(albedo=(0.3,) * 3, specular=(0.5,) * 3, gloss=50.0),
    )
    camera = gi.Camera.look_at((0, 0, 6), (0, 0, 0), yfov=0.2, width=61, height=47)
    lights = [gi.DirectionalLight((0.0, 0.0, -1.0), 0.2), gi.Environment((1.0, 1.0, 1.0))]
    found = radiance(wall, camera, lights, runtime)[23, 30]
    lobe = (50.0 + 1.0) / (2.0 * math.pi)  # straight back
    expected = 0.2 * (0.3 / math.pi + 0.5 * lobe) + (0.3 + 0.5)
    # The sky's directions sum to 1 within 1 %.
    np.testing.assert_allclose(found, expected, rtol=0.01)


def test_a_mirror_shows_what_is_not_seen_or_the_sky(runtime: Runtime) -> None:
    # Before a wall behind the camera, of which the left half sends 2 and the right half nothing.
    corners = np.float32([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    half = corners * np.float32([2, 4, 1]) + np.float32([2, 0, 8])
    points = np.concatenate([corners, half, half * np.float32([-1, 1, 1])])
    mirror = Material(albedo=(0.0,) * 3, specular=(0.5,) * 3, gloss=1e5)
    quads = halves(np.arange(12).reshape(3, 4))
    ids = [0, 0, 1, 1, 2, 2]
    room, dark = (scene_of(points, quads, mirror, matt(0.0), matt(0.0, sent), ids=ids) for sent in (2.0, 0.0))
    camera = gi.Camera.look_at((0, 0, 6), (0, 0, 0), yfov=0.2, width=61, height=47)
    found = radiance(room, camera, [SKY], runtime)[23]
    np.testing.assert_allclose(found[20], 0.5 * 2.0, rtol=0.1)  # .95: surfels are coarse
    assert found[55].max() < 0.05 * max(SKY.radiance), "the wall is black"
    found = radiance(dark, camera, [SKY], runtime)
    assert found[23, 30].max() < 0.05 * max(SKY.radiance), "nothing else shines"
    alone = replace(room, triangles=room.triangles[:2], material_ids=room.material_ids[:2])
    found = radiance(alone, camera, [SKY], runtime)
    np.testing.assert_allclose(found[23, 30], 0.5 * np.asarray(SKY.radiance), rtol=0.01)


def test_glossy_scenes_out_of_sight_leave_the_sky(runtime: Runtime) -> None:
    built = make_scene("cornell_box")
    scene = polished(built.scene)
    away = gi.Camera.look_at((0, 50, 50), (0, 100, 100), width=20, height=10)
    for camera in (built.camera(61, 47), away, built.camera(1, 1), away):
        found = radiance(scene, camera, (*built.lights, SKY), runtime, preset="low", **MAPS)
        assert np.isfinite(found).all()
        if camera is away:
            np.testing.assert_allclose(found, np.broadcast_to(SKY.radiance, found.shape), rtol=1e-6)


def test_nothing_is_glossy_where_nothing_is_drawn(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    """Numbers of triangles that were left in memory, here of the first, are not looked up."""
    scene = polished(make_scene("cornell_box").scene)
    rasterizer = Rasterizer(runtime, (10, 20), regions=True, world="until derived", lobes=True)
    array = runtime.transient.array

    def left_over(count: int, dtype: type[np.generic]) -> Any:
        made = array(count, dtype)
        made.upload(np.zeros(count, dtype))
        return made

    monkeypatch.setattr(runtime.transient, "array", left_over)
    away = gi.Camera.look_at((0, 50, 50), (0, 100, 100), width=20, height=10)
    with runtime.frame():
        rasterizer.render(device_scene(scene, runtime), away)  # the first clears all
        target = rasterizer.render(device_scene(scene, runtime), away)
        assert target.mirrors
        assert not target.specular.download().any()
        assert not target.gloss.download().any()
