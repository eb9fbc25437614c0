"""Sampled lights: directions against integrals, the kernels against numpy, and what they skip."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.environment_samples import CELLS, cell_directions, sample_environments, texels
from ssgi_cl.core.lights import Environment, PointLight
from ssgi_cl.core.sample_views import interleaved, sample_views
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.sampled_lights.sampled_lights import depth_map, sampled_lights_reference
from ssgi_cl.techniques.sampled_lights.sampled_lights import SampledLights, SampledLightsParams, sampled_lights
from ssgi_cl.techniques.sampled_lights.sampled_maps import SampledMaps

from ...closed_forms import made as scene_of
from ..vpl.given import uploaded

Doubles = NDArray[np.float64]


def _scene(*, inside_out: bool = False, origin: float = 0.0) -> Scene:
    """A floor with a table of one slab over a part of it."""
    quads = [
        [(-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)],
        [(-0.7, 0.8, -0.6), (-0.7, 0.8, 0.9), (0.8, 0.8, 0.9), (0.8, 0.8, -0.6)],
    ]
    points = np.array(quads, np.float32).reshape(-1, 3)
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], np.int32)
    if inside_out:
        triangles = triangles[:, ::-1]
    return Scene(
        origin=np.full(3, origin),
        positions=points,
        normals=np.tile(np.float32([0, 1, 0]), (8, 1)),
        uvs=np.zeros((8, 2), np.float32),
        colors=np.ones((8, 3), np.float32),
        triangles=triangles,
        material_ids=np.zeros(4, np.int32),
    )


def _camera(origin: float = 0.0) -> Camera:
    eye = np.array([2.5, 2.2, 3.0]) + origin
    return Camera.look_at(eye, np.full(3, origin), (0, 1, 0), yfov=0.8, width=45, height=34)


def _sky(rng: np.random.Generator, rows: int = 16) -> Environment:
    return Environment(rng.random((rows, 2 * rows, 3)) + 0.2)


def _exact(radiance: Any, normal: Doubles) -> Doubles:
    """The irradiance of a surface that nothing hides, by the midpoint rule."""
    image = np.atleast_3d(np.asarray(radiance, np.float64).reshape(-1, 1, 3) if np.ndim(radiance) == 1 else radiance)
    image = np.repeat(image, max(1, 512 // image.shape[0]), 0)
    image = np.repeat(image, max(1, 1024 // image.shape[1]), 1)
    towards, omega = texels(*image.shape[:2])
    weighted: Doubles = np.einsum("ij,ijc->c", np.maximum(towards @ normal, 0.0) * omega, image)
    return weighted


GRADIENT = np.repeat(np.linspace(1.0, 0.0, 64)[:, None, None] * np.array([1.0, 2.0, 4.0]) + 0.05, 128, 1)


@pytest.mark.parametrize("radiance", [np.ones(3), GRADIENT], ids=["constant", "gradient"])
def test_directions_sum_to_the_irradiance_of_any_normal(radiance: Doubles, rng: np.random.Generator) -> None:
    towards, flux = sample_environments([Environment(radiance)], 128)
    assert towards.shape == flux.shape == (128, 3)
    np.testing.assert_allclose(np.linalg.norm(towards, axis=1), 1.0, rtol=1e-12)
    normals = rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    exact = np.array([_exact(radiance, n) for n in normals])
    sums = np.maximum(normals @ towards.T, 0.0) @ flux
    # 128 regions: one that crosses the horizon errs by half of itself at most.
    assert np.abs(sums - exact).max() < 0.02 * exact.max()


def test_parts_that_count_more_have_more_directions_and_no_more_light() -> None:
    seen = np.full((16, 16), 0.02)
    seen[5:7, 9:12] = 1.0
    # The middle of a part's cells.
    cells = cell_directions().reshape(CELLS, CELLS, 3)
    towards, flux = sample_environments([Environment(GRADIENT)], 128, seen)
    row, column = np.divmod((towards @ cells.reshape(-1, 3).T).argmax(axis=1), CELLS)
    within = (row // 16 >= 5) & (row // 16 < 7) & (column // 16 >= 9) & (column // 16 < 12)
    # 6 of 256 parts, each 50 times as heavy, under a sky that varies by 2: between a third and three quarters.
    assert 0.33 < within.mean() < 0.75
    whole = np.stack([_exact(GRADIENT, normal) for normal in np.concatenate([np.eye(3), -np.eye(3)])])
    sums = np.maximum(np.concatenate([np.eye(3), -np.eye(3)]) @ towards.T, 0.0) @ flux
    # The other 60 directions are wide.
    assert np.abs(sums - whole).max() < 0.06 * whole.max()
    _, alike = sample_environments([Environment(GRADIENT)], 128)
    np.testing.assert_allclose(flux.sum(axis=0), alike.sum(axis=0), rtol=1e-9)


def test_all_flux_is_kept_by_any_size_of_image(rng: np.random.Generator) -> None:
    for shape in ((1, 1), (1, 100000), (3000, 2), (7, 13)):
        image = rng.random((*shape, 3)) * (rng.random((*shape, 1)) < 0.5) + 1e-3
        _, flux = sample_environments([Environment(image)], 64)
        _, omega = texels(*shape)
        whole = (image * omega[..., None]).sum(axis=(0, 1))
        # Rows of a block are not all of one solid angle.
        np.testing.assert_allclose(flux.sum(axis=0), whole, rtol=2e-3)


def test_two_environments_add_up(rng: np.random.Generator) -> None:
    a, b = _sky(rng), Environment((1.0, 2.0, 3.0))
    _, both = sample_environments([a, b], 32)
    parts = [sample_environments([each], 32)[1].sum(axis=0) for each in (a, b)]
    np.testing.assert_allclose(both.sum(axis=0), sum(parts), rtol=1e-9)


def test_a_single_bright_texel_and_no_light_at_all() -> None:
    image = np.zeros((64, 128, 3))
    assert sample_environments([Environment(image)], 64)[0].shape == (0, 3)
    image[20, 30] = 1e38
    towards, flux = sample_environments([Environment(image)], 64)
    assert len(towards) == 64
    assert np.isfinite(flux).all()
    assert flux.max() < 1e32
    assert (towards @ texels(64, 128)[0][20, 30] > 0.99).all()


@pytest.mark.parametrize("bad", [np.nan, -1.0, np.inf])
def test_an_environment_refuses_texels_that_are_no_radiance(bad: float) -> None:
    image = np.ones((4, 8, 3))
    image[2, 3, 1] = bad
    with pytest.raises(ValueError, match=r"radiance\[2, 3, 1\]"):
        Environment(image)


def test_each_pixel_of_a_tile_takes_one_of_every_16_neighbours() -> None:
    order = interleaved(64)
    assert order.shape == (4, 4, 4)
    for group in range(4):
        assert sorted(order[group].ravel()) == list(range(16 * group, 16 * group + 16))
    assert len(set(order[:, 0, 0] % 16)) > 1


@pytest.mark.parametrize("origin", [0.0, 5e4])
def test_every_kernel_variant_agrees_with_the_numpy_reference(
    runtime: Runtime, variant_runtime: Runtime, rng: np.random.Generator, origin: float
) -> None:
    scene, sky = _scene(origin=origin), _sky(rng)
    params = SampledLightsParams(directions=32, map_size=48, blur=0)
    for each in (runtime, variant_runtime):
        gbuffer = gi.rasterize.gbuffer(scene, _camera(origin), overscan=0.1, runtime=each)
        made = sampled_lights(gbuffer, [sky], scene=scene, directions=32, map_size=48, blur=0, runtime=each)
        towards, flux = sample_environments([sky], params.count)
        views, diagonals = sample_views(towards, scene.bounds - scene.origin, params.map_size)
        wanted = sampled_lights_reference(
            gbuffer, scene, towards, flux, views, diagonals, interleaved(params.count), params.map_size
        )
        # A tap that compares alike depths may fall either way; other differences are roundings.
        off = np.abs(made - wanted).max(axis=-1) > 1e-3 * wanted.max()
        assert off.mean() < 5e-3, off.mean()
        assert 0.1 < (wanted.mean() / wanted.max()) < 0.9


def _maps(runtime: Runtime, scene: Scene) -> tuple[NDArray[np.float32], Doubles]:
    """Return [16, 61, 61] maps of 16 directions, and their matrices."""
    with runtime.frame():
        made = SampledMaps(runtime, 16, 61).draw(scene, [Environment(1.0)])
        return made.ready().download().view(np.float32).reshape(16, 61, 61), made.views


def _strewn(rng: np.random.Generator) -> Scene:
    """Triangles of three sizes anywhere."""
    triangles = rng.permutation(300).reshape(100, 3).astype(np.int32)
    middle = rng.uniform(-1.0, 1.0, (100, 1, 3))
    size = rng.choice([0.02, 0.2, 1.0], (100, 1, 1))
    points = np.zeros((300, 3), np.float32)
    points[triangles] = middle + size * rng.uniform(-1.0, 1.0, (100, 3, 3))
    return scene_of(points, triangles)


def _clusters(rng: np.random.Generator) -> Scene:
    """Small triangles close together in runs, a third of them within a box of large ones that has an opening, and thin
    ones that lie across the texels."""
    middle = np.repeat(rng.uniform(-1.0, 1.0, (60, 1, 3)), 16, axis=0)
    middle += 0.15 * rng.uniform(-1.0, 1.0, middle.shape)
    small = middle + 0.04 * rng.uniform(-1.0, 1.0, (len(middle), 3, 3))
    x, y = np.meshgrid([-0.7, 0.7], [-0.7, 0.7])
    side = np.stack([x, y, np.full_like(x, 0.7)], axis=-1).reshape(4, 3)[[0, 1, 2, 3, 2, 1]].reshape(2, 3, 3)
    walls = [sign * np.roll(side, turn, axis=2) for turn in range(3) for sign in (-1.0, 1.0)][1:]
    start = rng.uniform(-1.0, 1.0, (50, 1, 3))
    thin = start + np.array([0.0, 0.01, 1.0])[:, None] * rng.uniform(-1.0, 1.0, (50, 3, 3))
    corners = np.concatenate([small, *walls, thin]).astype(np.float32)
    return scene_of(corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3))


@pytest.mark.parametrize("made", [_strewn, _clusters])
def test_maps_have_the_depth_of_numpy_in_every_texel(
    runtime: Runtime, variant_runtime: Runtime, rng: np.random.Generator, made: Callable[[np.random.Generator], Scene]
) -> None:
    scene = made(rng)
    for each in (runtime, variant_runtime):
        maps, views = _maps(each, scene)
        wanted = np.array([depth_map(scene, matrix, 61) for matrix in views])
        seen = np.isfinite(wanted)
        assert 0.1 < seen.mean() < 0.9
        # An edge within a rounding of a texel's middle falls to either side; measured: none does.
        off = ~np.isclose(maps, wanted, rtol=1e-3, atol=1e-4)
        assert off.sum() <= 1, off.sum()


def test_bit_identical_results_from_run_to_run_and_when_drawn_anew(runtime: Runtime) -> None:
    scene, sky = _scene(), Environment(1.0)
    gbuffer = gi.rasterize.gbuffer(scene, _camera(), runtime=runtime)
    first = sampled_lights(gbuffer, [sky], scene=scene, directions=32, runtime=runtime)
    for again in (sky, Environment(1.0)):
        now = sampled_lights(gbuffer, [again], scene=scene, directions=32, runtime=runtime)
        np.testing.assert_array_equal(first, now)


def test_an_open_floor_has_all_the_light_and_under_a_table_it_is_dark(runtime: Runtime) -> None:
    scene = _scene()
    down = Camera.look_at((0, 6, 0.01), (0, 0, 0), (0, 0, -1), yfov=0.7, width=64, height=64)
    gbuffer = gi.rasterize.gbuffer(scene, down, runtime=runtime)
    light = sampled_lights(gbuffer, [Environment(1.0)], scene=scene, runtime=runtime)[..., 0]
    up = sample_environments([Environment(1.0)], 128)
    unhidden = float(np.maximum(up[0][:, 1], 0.0) @ up[1][:, 0])
    # The slab's upper side, away from its edge, sees all the sky.
    np.testing.assert_allclose(light[30:34, 30:34], unhidden, rtol=0.02)
    low = Camera.look_at((0.0, 0.4, 3.0), (0, 0.0, 0), (0, 1, 0), yfov=0.3, width=32, height=32)
    under = sampled_lights(
        gi.rasterize.gbuffer(scene, low, runtime=runtime), [Environment(1.0)], scene=scene, runtime=runtime
    )[..., 0]
    assert 0.1 < under[16, 16] / unhidden < 0.6


def test_inside_out_changes_nothing(runtime: Runtime) -> None:
    images = []
    for inside_out in (False, True):
        scene = _scene(inside_out=inside_out)
        gbuffer = gi.rasterize.gbuffer(_scene(), _camera(), runtime=runtime)
        images.append(sampled_lights(gbuffer, [Environment(1.0)], scene=scene, directions=32, runtime=runtime))
    np.testing.assert_allclose(images[0], images[1], atol=1e-5)


def test_without_an_environment_nothing_is_drawn(runtime: Runtime) -> None:
    scene = _scene()
    gbuffer = gi.rasterize.gbuffer(scene, _camera(), runtime=runtime)
    device = uploaded(runtime, gbuffer)
    technique = SampledLights(runtime, gbuffer.size, SampledLightsParams(directions=16))
    with runtime.frame():
        for lights in ((), (PointLight((0, 1, 0), 1.0),), (Environment(0.0),)):
            assert technique.run(device, lights, scene=scene) is None
        assert [entry.name for entry in runtime.times() if not entry.skipped] == []
    assert not sampled_lights(gbuffer, [], scene=scene, runtime=runtime).any()


def test_maps_are_kept_while_scene_and_environments_are_the_same(runtime: Runtime) -> None:
    scene, sky = _scene(), Environment(1.0)
    device = uploaded(runtime, gi.rasterize.gbuffer(scene, _camera(), runtime=runtime))
    technique = SampledLights(runtime, device.size, SampledLightsParams(directions=16, map_size=32))

    def drawn(scene: Scene, sky: Environment) -> bool:
        with runtime.frame():
            technique.run(device, [sky], scene=scene)
        names = [entry.name for entry in runtime.times() if not entry.skipped]
        return "sampled_depth" in names

    assert drawn(scene, sky)
    assert not drawn(scene, sky)
    assert drawn(_scene(), sky)


def test_directions_are_those_of_the_environments_of_the_frame(runtime: Runtime, rng: np.random.Generator) -> None:
    scene, skies = _scene(), [_sky(rng), Environment((1.0, 2.0, 3.0)), _sky(rng)]
    device = uploaded(runtime, gi.rasterize.gbuffer(scene, _camera(), runtime=runtime))
    params = SampledLightsParams(directions=32, map_size=32)

    def light(technique: SampledLights, sky: Environment) -> NDArray[np.float32]:
        with runtime.frame():
            plane = technique.run(device, [sky], scene=scene)
            assert plane is not None
            return np.array(plane.download())

    kept = SampledLights(runtime, device.size, params)
    for sky in skies:
        np.testing.assert_array_equal(light(kept, sky), light(SampledLights(runtime, device.size, params), sky))


@pytest.mark.parametrize(("alpha", "texel"), [(1.0, 0), (0.6, 170)], ids=["texture", "texture times alpha"])
def test_holes_that_alpha_cuts_out_let_light_through(variant_runtime: Runtime, alpha: float, texel: int) -> None:
    # A sheet above a floor, half of it cut out, is a sheet of half the size.
    floor = np.array([[-2, 0, -2], [2, 0, -2], [2, 0, 2], [-2, 0, 2]], np.float32)
    texels = np.full((8, 8, 4), 255, np.uint8)
    texels[:, 4:, 3] = texel  # .6 times 170 of 255 is .4, and of the mean of 170 and 255 it is .5
    maps = []
    for right, textures in ((1.0, (texels,)), (0.0, ())):
        sheet = np.array([[-1, 1, -1], [right, 1, -1], [right, 1, 1], [-1, 1, 1]], np.float32)
        scene = Scene(
            positions=np.concatenate([floor, sheet]), normals=np.zeros((8, 3), np.float32),
            uvs=np.tile(np.float32([[0, 0], [1, 0], [1, 1], [0, 1]]), (2, 1)),
            colors=np.ones((8, 3), np.float32), textures=textures,
            triangles=np.int32([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]]),
            material_ids=np.int32([0, 0, 1, 1]),
            materials=(Material(), Material(texture=0, alpha=alpha, alpha_cutoff=0.5) if textures
                       else Material()),
        )  # fmt: skip
        maps.append(_maps(variant_runtime, scene)[0])
    # Where the hole ends within a rounding of a texel's middle, it falls to either side.
    assert (~np.isclose(*maps, rtol=1e-3, atol=1e-4)).mean() < 2e-3
