"""Sky by rays: strata against integrals, a window against its closed form, shadows against rays to everywhere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.environment_samples import POINTS, environment_strata, texels
from ssgi_cl.core.lights import Environment, PointLight
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.reference.area_lights.area_lights import polygon_irradiance
from ssgi_cl.reference.gbuffer import SurfaceView
from ssgi_cl.reference.sky_rays.sky_rays import sky_rays_reference, unblocked
from ssgi_cl.techniques.sampled_lights.sampled_lights import SampledLights, SampledLightsParams
from ssgi_cl.techniques.sampled_lights.sampled_maps import SampledMaps
from ssgi_cl.techniques.sky_rays.enclosed import OPEN, openness, sky_by_rays
from ssgi_cl.techniques.sky_rays.sky_rays import SkyRays

from ..vpl.given import uploaded

Doubles = NDArray[np.float64]
Quad = tuple[Sequence[float], Sequence[float], Sequence[float]]

GRADIENT = np.repeat(np.linspace(1.0, 0.0, 64)[:, None, None] * np.array([1.0, 2.0, 4.0]) + 0.05, 128, 1)
WIDE, HIGH = 2.0, 2.6
LOW, UP = (1.0, -0.8), (2.0, 0.8)
"""Height and z of two corners of the window in the wall of +x."""
FLOOR: Quad = ((-2, 0, -2), (0, 0, 4), (4, 0, 0))
TABLE: Quad = ((-0.7, 0.8, -0.6), (0, 0, 1.5), (1.5, 0, 0))


def scene_of(parts: Sequence[Quad], *, origin: float = 0.0, **given: Any) -> Scene:
    """Parallelograms, each a corner and two edges."""
    points, normals, faces = [], [], []
    for number, part in enumerate(parts):
        corner, first, second = (np.asarray(p, np.float64) for p in part)
        across = np.cross(first, second)
        points += [corner, corner + first, corner + first + second, corner + second]
        normals += [across / np.linalg.norm(across)] * 4
        faces += [[4 * number + k for k in t] for t in ((0, 1, 2), (0, 2, 3))]
    values: dict[str, Any] = {
        "uvs": np.zeros((len(points), 2), np.float32), "material_ids": np.zeros(len(faces), np.int32), **given
    }  # fmt: skip
    return Scene(
        origin=np.full(3, origin), positions=np.array(points, np.float32), normals=np.array(normals, np.float32),
        colors=np.ones((len(points), 3), np.float32), triangles=np.array(faces, np.int32), **values,
    )  # fmt: skip


def room() -> Scene:
    """A room of single sheets with a window."""
    x, z = WIDE, WIDE
    parts: list[Quad] = [
        ((-x, 0, -z), (0, 0, 2 * z), (2 * x, 0, 0)),
        ((-x, HIGH, -z), (2 * x, 0, 0), (0, 0, 2 * z)),
        ((-x, 0, -z), (2 * x, 0, 0), (0, HIGH, 0)),
        ((-x, 0, z), (0, HIGH, 0), (2 * x, 0, 0)),
        ((-x, 0, -z), (0, HIGH, 0), (0, 0, 2 * z)),
    ]
    around = (
        ((0, -z), (LOW[0], z)),
        ((UP[0], -z), (HIGH, z)),
        ((LOW[0], -z), (UP[0], LOW[1])),
        ((LOW[0], UP[1]), (UP[0], z)),
    )
    parts += [((x, a, b), (0, 0, d - b), (0, c - a, 0)) for (a, b), (c, d) in around]
    return scene_of(parts)


def view(columns: int = 45, rows: int = 34, origin: float = 0.0) -> Camera:
    eye = np.array([2.5, 2.2, 3.0]) + origin
    return Camera.look_at(eye, np.full(3, origin), (0, 1, 0), yfov=0.8, width=columns, height=rows)


def inside(columns: int, rows: int) -> Camera:
    return Camera.look_at((-1.7, 1.5, 1.5), (0.4, 0.7, -0.4), (0, 1, 0), yfov=1.1, width=columns, height=rows)


def exact(radiance: Any, normal: Doubles) -> Doubles:
    """The irradiance of a surface that nothing hides, by the midpoint rule."""
    image = np.asarray(radiance, np.float64)
    image = np.tile(image, (512, 1024, 1)) if image.ndim == 1 else np.repeat(np.repeat(image, 8, 0), 8, 1)
    towards, omega = texels(*image.shape[:2])
    light: Doubles = np.einsum("ij,ijc->c", np.maximum(towards @ normal, 0.0) * omega, image)
    return light


def unit_vectors(rng: np.random.Generator, count: int) -> Doubles:
    found: Doubles = rng.normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1)[:, None]


def disc(degrees: float, towards: Sequence[float]) -> Environment:
    ways, _ = texels(256, 512)
    near = ways @ (np.asarray(towards) / np.linalg.norm(towards)) > math.cos(math.radians(degrees / 2))
    return Environment(np.where(near[..., None], np.array([40.0, 30.0, 20.0]), 0.0))


@pytest.mark.parametrize("radiance", [np.ones(3), GRADIENT], ids=["constant", "gradient"])
def test_strata_sum_to_the_irradiance_of_any_normal(radiance: Doubles, rng: np.random.Generator) -> None:
    strata = environment_strata([Environment(radiance)], 128)
    normals = unit_vectors(rng, 40)
    right = np.array([exact(radiance, n) for n in normals])
    # A stratum across the horizon is taken to be even and round; one direction for each errs by 2 %.
    assert np.abs(unblocked(strata, normals) - right).max() < 0.01 * right.max()


def test_directions_of_a_stratum_stand_for_its_light(rng: np.random.Generator) -> None:
    sky = Environment(rng.random((16, 32, 3)) ** 4)
    strata = environment_strata([sky], 64)
    assert strata.points.shape == (64, POINTS, 3)
    np.testing.assert_allclose(np.linalg.norm(strata.points, axis=2), 1.0, rtol=1e-12)
    # 64 quantiles of 256 x 256 cells.
    np.testing.assert_allclose(strata.points.mean(axis=1), strata.vectors, atol=0.03)
    _, omega = texels(16, 32)
    np.testing.assert_allclose(strata.flux.sum(axis=0), (sky.radiance * omega[..., None]).sum(axis=(0, 1)), rtol=2e-3)
    off = np.linalg.norm(strata.points - strata.vectors[:, None], axis=2).max(axis=1)
    assert (strata.reach <= off * 1.02).all()
    # Quarters are parts: their middles lie apart.
    quarters = strata.points.reshape(64, 4, -1, 3).mean(axis=2)
    apart = np.linalg.norm(quarters[:, 0] - quarters[:, 3], axis=1)
    assert np.median(apart / strata.spread) > 0.7


def test_solid_angles_fill_the_sphere_and_dark_skies_have_no_strata() -> None:
    assert environment_strata([Environment(1.0)], 32).solid_angle.sum() == pytest.approx(4.0 * math.pi)
    assert len(environment_strata([Environment(0.0)], 32).flux) == 0
    assert environment_strata([Environment(0.0)], 32).points.shape == (0, POINTS, 3)


def through_the_window(seen: gi.GBuffer, scene: Scene) -> tuple[Doubles, NDArray[np.bool_]]:
    """Return irradiance of what is seen of `room` by a sky of radiance 1, and where something is."""
    position, normal, there = SurfaceView.of(seen).in_scene(scene.origin)
    (y0, z0), (y1, z1) = LOW, UP
    window = np.array([(WIDE, y0, z0), (WIDE, y0, z1), (WIDE, y1, z1), (WIDE, y1, z0)])
    right = np.zeros(seen.size)
    right[there] = np.abs(polygon_irradiance(window, position[there], normal[there]))
    return right, there


@pytest.mark.parametrize(("columns", "rows", "rays", "error"), [(400, 300, 1, 0.18), (400, 300, 8, 0.12)])
def test_light_through_a_window_is_that_of_its_polygon(
    runtime: Runtime, columns: int, rows: int, rays: int, error: float
) -> None:
    scene = room()
    seen = drawn(scene, inside(columns, rows), runtime=runtime)
    right, there = through_the_window(seen, scene)
    known = right > 1e-4
    assert known.mean() > 0.5
    found = gi.sky_rays(seen, [Environment(1.0)], scene=scene, rays=rays, runtime=runtime)[..., 0]
    mean = right[known].mean()
    # One ray a pixel of every second row, in a blur of 32 x 48 pixels at most: 12 to 16 %. Depth maps of 128
    # directions have 53 %.
    assert np.sqrt(np.mean((found - right)[known] ** 2)) < error * mean
    assert abs(found[known].mean() / mean - 1.0) < 0.03
    # No patch that the light does not reach.
    bright = right > 0.5 * mean
    assert np.percentile(found[bright] / right[bright], 1) > 0.5
    # The window's own wall, but for pixels that it shares with others.
    assert np.percentile(found[there & (right < 1e-9)], 99) < 0.02 * mean


def test_shadows_are_those_of_rays_to_all_directions(runtime: Runtime, rng: np.random.Generator) -> None:
    scene = scene_of([FLOOR, TABLE], origin=40.0)
    sky = Environment(rng.random((8, 16, 3)) + 0.2)
    seen = drawn(scene, view(origin=40.0), runtime=runtime)
    right = sky_rays_reference(seen, scene, environment_strata([sky], 128))
    found = gi.sky_rays(seen, [sky], scene=scene, rays=16, runtime=runtime)
    error = found - right
    # 16 rays in a blur of 6 pixels, as wide as a sixth of the table.
    assert np.sqrt(np.mean(error**2)) < 0.06 * right.max()
    assert np.abs(error.mean(axis=(0, 1)) / right.mean(axis=(0, 1))).max() < 0.02
    assert right.min() < 0.5 * right.max()


def test_a_surface_that_sees_all_the_sky_has_no_noise(runtime: Runtime) -> None:
    scene = scene_of([FLOOR])
    for sky in (Environment((1.0, 2.0, 3.0)), Environment(GRADIENT)):
        found = gi.sky_rays(drawn(scene, view(), runtime=runtime), [sky], scene=scene, runtime=runtime)
        lit = found[found[..., 0] > 0.0]
        right = exact(sky.radiance, np.array([0.0, 1.0, 0.0]))
        # Strata across the horizon, and one colour of each.
        np.testing.assert_allclose(lit, np.tile(right, (len(lit), 1)), rtol=0.03)


def test_the_umbra_of_a_bright_disc_is_dark(runtime: Runtime) -> None:
    scene = scene_of([FLOOR, TABLE])
    towards = (0.3, 1.0, 0.2)
    sky = disc(10.0, towards)
    seen = drawn(scene, view(400, 300), runtime=runtime)
    position, _, there = SurfaceView.of(seen).in_scene(scene.origin)
    found = gi.sky_rays(seen, [sky], scene=scene, runtime=runtime)[..., 0]
    # Where the cone to the disc goes through the table, with room for the blur: its rim does.
    axis = np.asarray(towards) / np.linalg.norm(towards)
    side = np.cross(axis, (0.0, 0.0, 1.0)) / np.linalg.norm(np.cross(axis, (0.0, 0.0, 1.0)))
    turn = np.linspace(0.0, 2.0 * math.pi, 16)[:, None]
    rim = axis + math.tan(math.radians(5.5)) * (np.cos(turn) * side + np.sin(turn) * np.cross(axis, side))
    hit = position[..., None, :] + rim * (0.8 / rim[:, 1:2])
    through = (np.abs(hit[..., 0] - 0.05) < 0.65) & (np.abs(hit[..., 2] - 0.15) < 0.65)
    on_floor = there & (np.abs(position[..., 1]) < 1e-3)
    umbra = on_floor & through.all(axis=-1)
    lit = on_floor & ~through.any(axis=-1) & (np.abs(position[..., 0]) < 1.9) & (np.abs(position[..., 2]) < 1.9)
    assert np.count_nonzero(umbra) > 300
    ways, omega = texels(256, 512)
    right = np.einsum("ijc,ij->c", np.asarray(sky.radiance), omega * np.maximum(ways[..., 1], 0.0))
    assert found[umbra].mean() < 2e-3 * right[0]
    assert np.percentile(found[umbra], 99) < 0.03 * right[0]  # a blur of 6 pixels at least
    np.testing.assert_allclose(np.median(found[lit]), right[0], rtol=0.02)


def test_every_kernel_variant_agrees(runtime: Runtime, variant_runtime: Runtime) -> None:
    scene, sky = room(), Environment(GRADIENT)
    images = [
        gi.sky_rays(drawn(scene, inside(141, 100), runtime=each), [sky], scene=scene, runtime=each)
        for each in (runtime, variant_runtime)
    ]
    # A ray that passes an edge within a rounding falls to either side.
    assert np.mean(np.abs(images[0] - images[1]) > 0.02 * images[0].max()) < 0.01


def test_light_passes_the_holes_that_alpha_cuts_out(runtime: Runtime) -> None:
    sheet: Quad = ((-1.0, 0.8, -1.0), (0, 0, 2), (2, 0, 0))
    texel = np.full((16, 16, 4), 255, np.uint8)
    texel[:, 8:, 3] = 0  # columns of large u, which runs along x
    uvs = np.zeros((8, 2), np.float32)
    uvs[4:] = [(0, 0), (0, 1), (1, 1), (1, 0)]
    pierced = scene_of(
        [FLOOR, sheet], uvs=uvs, textures=(texel,), material_ids=np.int32([0, 0, 1, 1]),
        materials=(Material(), Material(texture=0, alpha_cutoff=0.5)),
    )  # fmt: skip
    half: Quad = ((-1.0, 0.8, -1.0), (0, 0, 2), (1, 0, 0))
    seen = drawn(scene_of([FLOOR, half]), view(120, 90), runtime=runtime)
    found, right, whole = (
        gi.sky_rays(seen, [Environment(1.0)], scene=scene, rays=8, runtime=runtime)[..., 0]
        for scene in (pierced, scene_of([FLOOR, half]), scene_of([FLOOR, sheet]))
    )
    assert np.sqrt(np.mean((found - right) ** 2)) < 0.05 * right.max()
    assert np.sqrt(np.mean((whole - right) ** 2)) > 0.09 * right.max()


def test_a_margin_changes_little(runtime: Runtime) -> None:
    scene = room()
    inner, outer = (
        gi.sky_rays(
            drawn(scene, inside(141, 100), overscan=overscan, runtime=runtime), [Environment(1.0)],
            scene=scene, runtime=runtime,
        )
        for overscan in (0.0, 0.15)
    )  # fmt: skip
    # Rows and columns of the image are drawn with other offsets: one rounding of a pixel's position.
    assert np.percentile(np.abs(inner - outer), 99) < 0.02 * inner.max()


def test_bit_identical_results_from_run_to_run(runtime: Runtime) -> None:
    scene, sky = room(), Environment(1.0)
    seen = drawn(scene, inside(100, 70), runtime=runtime)
    first = gi.sky_rays(seen, [sky], scene=scene, runtime=runtime)
    assert first.any()
    for again in (sky, Environment(1.0)):
        np.testing.assert_array_equal(first, gi.sky_rays(seen, [again], scene=scene, runtime=runtime))


def test_without_an_environment_nothing_is_lit(runtime: Runtime) -> None:
    scene = room()
    seen = drawn(scene, inside(40, 30), runtime=runtime)
    technique = SkyRays(runtime, seen.size)
    with runtime.frame():
        for lights in ((), (PointLight((0, 1, 0), 1.0),), (Environment(0.0),)):
            assert technique.run(uploaded(runtime, seen), lights, scene=scene) is None
    assert not gi.sky_rays(seen, [], scene=scene, runtime=runtime).any()


def test_light_is_proportional_to_radiance(runtime: Runtime) -> None:
    scene = room()
    seen = drawn(scene, inside(60, 45), runtime=runtime)
    base = gi.sky_rays(seen, [Environment(1.0)], scene=scene, runtime=runtime)
    for factor in (1e-12, 1e12):
        light = gi.sky_rays(seen, [Environment(factor)], scene=scene, runtime=runtime)
        np.testing.assert_allclose(light / factor, base, rtol=1e-4, atol=1e-6)
    assert np.isfinite(gi.sky_rays(seen, [Environment(1e30)], scene=scene, runtime=runtime)).all()


def test_a_room_is_enclosed_and_a_floor_is_not(runtime: Runtime) -> None:
    # The window's 1.6 of the room's 73.6 square metres; walls are met more or less by their places.
    assert openness(room(), runtime).share == pytest.approx(1.6 / 73.6, rel=0.25)
    assert sky_by_rays(room(), runtime)
    assert openness(scene_of([FLOOR, TABLE]), runtime).share > OPEN
    assert not sky_by_rays(scene_of([FLOOR, TABLE]), runtime)


def test_more_directions_pass_openings_where_it_is_known_which_do(runtime: Runtime) -> None:
    scene, sky = room(), [Environment(1.0)]
    seen = drawn(scene, inside(200, 150), runtime=runtime)
    right, _ = through_the_window(seen, scene)
    known = right > 1e-4
    errors = []
    for parts in (None, openness(scene, runtime).seen):
        technique = SampledLights(runtime, seen.size, SampledLightsParams(directions=128, map_size=128))
        with runtime.frame():
            maps = SampledMaps(runtime, 128, 128).draw(scene, sky, parts)
            light = technique.run(uploaded(runtime, seen), sky, scene=scene, maps=maps)
            assert light is not None
            found = light.download()[0]
        errors.append(math.sqrt(np.mean((found - right)[known] ** 2)) / right[known].mean())
    # .47 and .32: directions that pass the window are some times as many; a pixel tests a sixteenth of them.
    assert errors[0] > 0.4
    assert errors[1] < 0.75 * errors[0]


@pytest.mark.parametrize("enclosed", [False, True])
def test_frames_take_rays_where_a_scene_is_enclosed(runtime: Runtime, enclosed: bool) -> None:
    scene = room() if enclosed else scene_of([FLOOR, TABLE])
    gi.render(scene, inside(60, 45) if enclosed else view(60, 45), [Environment(1.0)], runtime=runtime)
    done = {entry.name for entry in runtime.times() if not entry.skipped}
    assert ("sky_rays" in done) == enclosed
    assert ("sampled_lights" in done) == (not enclosed)
    assert ("gtao" in done) == (not enclosed)


@pytest.mark.parametrize(
    ("values", "message"), [({"rays": 0}, "rays is 0"), ({"strata": 257}, "strata is 257"), ({"blur": 0}, "blur is 0")]
)
def test_parameters_out_of_range_are_refused(runtime: Runtime, values: dict[str, int], message: str) -> None:
    seen = drawn(room(), inside(20, 15), runtime=runtime)
    with pytest.raises(ValueError, match=message):
        gi.sky_rays(seen, [Environment(1.0)], scene=room(), runtime=runtime, **values)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="scene is NoneType"):
        gi.sky_rays(seen, [Environment(1.0)], scene=None, runtime=runtime)  # type: ignore[arg-type]


def test_a_side_turned_from_the_window_takes_nothing_from_the_side_beside_it(runtime: Runtime) -> None:
    # Of the parts of the sky that the cell's other surface sees, all lie below this one.
    room = make_scene("window-301")
    camera = room.camera(800, 600)
    seen = drawn(room.scene, camera, runtime=runtime)
    sky = gi.sky_rays(seen, [Environment((1.0, 1.0, 1.0))], scene=room.scene, runtime=runtime)
    top, front = sky[190:196, 644:668], sky[202:222, 644:668]
    assert top.mean() > 0.01 * math.pi
    assert front.max() < 1e-3 * top.mean()
