"""Bent normals of GTAO: against quadrature, marching and rays, and against the numpy reference."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.sampling import basis, directions, hashed, r2_points, wrapped
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as rasterized
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.ao.gtao import arc_directions, arc_integral, bent_reference
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams, gtao

from ..analytic import CAMERAS, VIEWS, Ball, camera, check_second_run, tilted, trace, uploaded, view_of
from ..walls import wall_and_floor

Doubles = NDArray[np.float64]

RADIUS = 0.6
ROUNDING = 1e-4
"""Of a coordinate: measured at most 9e-5, where little is open and the sum of directions short."""
FLIPS = 1e-3
"""Share of pixels in which a tap may fall to the other side of the radius; measured: none."""


def bent(gbuffer: GBuffer, radius: float = RADIUS, **options: Any) -> NDArray[np.float32]:
    return gtao(gbuffer, radius, bent_normals=True, **options)[1]


def degrees(a: NDArray[Any], b: NDArray[Any]) -> Doubles:
    """Return the angles between unit vectors, exact for small ones."""
    half = 0.5 * np.linalg.norm(np.asarray(a, np.float64) - b, axis=-1)
    angle: Doubles = np.degrees(2.0 * np.arcsin(np.minimum(half, 1.0)))
    return angle


def share_off(a: NDArray[Any], b: NDArray[Any]) -> float:
    return float(np.mean(~(np.abs(a - b).max(axis=-1) <= ROUNDING)))


def normal_of(gbuffer: GBuffer) -> NDArray[np.float32]:
    normal = gbuffer.first("normal")
    assert normal is not None
    return gbuffer.inner(normal)


# ---- the definition


def test_sums_over_an_arc_are_those_of_a_quadrature(rng: np.random.Generator) -> None:
    nodes, weights = np.polynomial.legendre.leggauss(48)
    for _ in range(100):
        g, h, side = rng.uniform(-1.5, 1.5), rng.uniform(0.0, np.pi), rng.choice((1, -1))
        plane: Any = SimpleNamespace(sin_normal=np.sin(g), cos_normal=np.cos(g))
        t = 0.5 * h * (nodes + 1.0)
        measure = 0.5 * h * weights * np.cos(t - side * g) * np.sin(t)
        wanted = (measure @ np.cos(t), measure @ np.sin(t), measure.sum())
        found = (*arc_directions(h, plane, side), arc_integral(h, plane, side))
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13)


def _mean_direction(hidden: Callable[[Doubles], NDArray[np.bool_]]) -> Doubles:
    """Return the mean of the directions above y = 0 that are not hidden, weighted by y."""
    u, v = np.meshgrid((np.arange(500) + 0.5) / 500, (np.arange(500) + 0.5) / 500)
    ring, angle = np.sqrt(u), 2.0 * np.pi * v
    way = np.stack([ring * np.cos(angle), np.sqrt(1.0 - u), ring * np.sin(angle)], axis=-1)
    mean: Doubles = np.where(hidden(way)[..., None], 0.0, way).sum(axis=(0, 1))
    return mean / np.linalg.norm(mean)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_floor_by_an_infinite_wall_bends_as_much_as_a_quadrature_says(runtime: Runtime, kind: str) -> None:
    gbuffer, distance = wall_and_floor(kind)
    found = bent(gbuffer, 1.0, slices=16, taps=48, blur_radius=0, runtime=runtime)
    for near, far in ((0.1, 0.12), (0.3, 0.32), (0.6, 0.62), (0.9, 0.92), (1.02, 1.2)):
        there = (distance > near) & (distance < far)
        middle = 0.5 * (near + far)
        # Within the radius of 1 is what a ray along `way` meets of the wall x = 0 before that.
        wanted = _mean_direction(lambda way, d=middle: way[..., 0] <= -d)  # type: ignore[misc]
        mean = found[there].mean(axis=0)
        # The highest point within the radius lies up to a tap beyond the highest tap: measured, at
        # most 0.54 degrees.
        assert float(degrees(mean / np.linalg.norm(mean), wanted)) < 0.8


def test_hills_seen_from_above_bend_as_marched_rays_say(runtime: Runtime, rng: np.random.Generator) -> None:
    tops, widths = rng.uniform(-1.6, 1.6, (9, 2)), rng.uniform(0.2, 0.5, 9)

    def height(x: Doubles, z: Doubles) -> Doubles:
        squared = (x[..., None] - tops[:, 0]) ** 2 + (z[..., None] - tops[:, 1]) ** 2
        hills: Doubles = np.exp(-0.5 * squared / widths**2).sum(axis=-1)
        return hills

    size = 240
    made = Camera.orthographic((0, 5, 0), (0, 0, 0), (0, 0, -1), view_height=4.0, width=size, height=size)
    plane = made.unproject(np.full((size, size), 5.0, np.float32))
    x, z = plane[..., 0], plane[..., 2]
    y, tiny = height(x, z), 1e-4
    up = np.stack(
        [
            (height(x - tiny, z) - height(x + tiny, z)) / (2 * tiny),
            np.ones_like(x),
            (height(x, z - tiny) - height(x, z + tiny)) / (2 * tiny),
        ],
        axis=-1,
    )
    up /= np.linalg.norm(up, axis=-1, keepdims=True)
    gbuffer = GBuffer(camera=made, depth=(5.0 - y).astype(np.float32), normal=up)
    # Nothing above a height field lies beyond its highest point: an endless radius.
    a, found = gtao(gbuffer, 1e3, 16, 48, bent_normals=True, blur_radius=0, runtime=runtime)
    assert a.min() < 0.7
    errors, bends = [], []
    for row, column in rng.integers(60, 180, (6, 2)):
        start = np.array([x[row, column], y[row, column], z[row, column]])
        normal = up[row, column]
        way = rng.standard_normal((3000, 3))
        way = way / np.linalg.norm(way, axis=-1, keepdims=True) + normal  # cosine-weighted
        way /= np.linalg.norm(way, axis=-1, keepdims=True)
        along = np.linspace(0.005, 1.0, 75)[:, None] ** 2 * 3.0
        at = start[:, None, None] + way.T[:, None] * along
        inside = (np.abs(at[0]) < 2.0) & (np.abs(at[2]) < 2.0)  # what the image shows
        free = ~np.any(inside & (height(at[0], at[2]) > at[1] + 1e-6), axis=0)
        wanted = way[free].sum(axis=0)
        wanted /= np.linalg.norm(wanted)
        errors.append(float(degrees(found[row, column], wanted)))
        bends.append(float(degrees(normal, wanted)))
    assert np.mean(bends) > 8.0
    # The mean of 3000 rays is off by about 60 / sqrt(3000) = 1.1 degrees itself. Measured: 1.1 on
    # average, 1.9 at most.
    assert np.mean(errors) < 1.5
    assert max(errors) < 4.0


@pytest.mark.slow
def test_cornell_box_bends_as_rays_through_the_mesh_say(runtime: Runtime) -> None:
    pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")
    from ssgi_cl.truth.raycast import RayCaster

    made = BUILTIN_SCENES["cornell_box"]()
    view = made.camera(100, 75)
    gbuffer = rasterized(made.scene, view, runtime=runtime)
    caster = RayCaster(made.scene)
    spots = caster.spots(view, slice(0, 75), gbuffer)
    rays, count = 256, len(spots.pixel)
    shift = hashed(np.arange(2 * count, dtype=np.uint64).reshape(2, count))
    total, free = np.zeros((count, 3)), np.zeros(count)
    for point in r2_points(0, rays):
        u, v = wrapped(point[:, None] + shift)
        way = directions(u, v, basis(spots.axis), "cosine")
        below = np.sum(way * spots.normal, axis=-1) <= 0.0
        reach = np.where(below, -1.0, made.ao_radius * caster.scale).astype(np.float32)
        seen = ~(caster.blocked(spots.start, way, reach) | below)
        total += way * seen[:, None]
        free += seen / rays
    enough = free > 0.1  # of fewer rays the mean direction is not known well
    truth = total[enough] / np.linalg.norm(total[enough], axis=-1, keepdims=True)
    found = bent(gbuffer, made.ao_radius, runtime=runtime).reshape(-1, 3)[spots.pixel][enough]
    normal = normal_of(gbuffer).reshape(-1, 3)[spots.pixel][enough]
    # Where rays meet what the image doesn't show, no scan bends. Measured: 4.7 degrees on average,
    # 3.1 at the median, 12.6 for the surface's own normals; at 200 x 150 with 512 rays 3.8, 2.2
    # and 12.4.
    assert degrees(normal, truth).mean() > 11.0
    assert degrees(found, truth).mean() < 5.5
    assert np.median(degrees(found, truth)) < 4.0


# ---- against the numpy reference


@pytest.mark.parametrize(("name", "kind"), VIEWS)
def test_kernel_agrees_with_numpy_reference_in_every_scene_and_camera(runtime: Runtime, name: str, kind: str) -> None:
    gbuffer = view_of(name, kind)
    found = bent(gbuffer, blur_radius=0, runtime=runtime)
    wanted = bent_reference(gbuffer, GtaoParams(radius=RADIUS, blur_radius=0))
    assert share_off(found, wanted) <= FLIPS


VARIANTS: list[dict[str, Any]] = [
    {"resolution": "half", "falloff": 0.3, "thin_occluder": 0.7, "contrast": 2.2},
    {"resolution": "half", "blur_resolution": "full", "blur_passes": 2},
]


@pytest.mark.parametrize(
    "choice", [*VARIANTS, pytest.param({"resolution": "quarter"}, marks=pytest.mark.slow)], ids=str
)
@pytest.mark.parametrize("margin", [pytest.param((0, 0), marks=pytest.mark.slow), (3, 5)], ids=str)
def test_every_kernel_variant_agrees_with_numpy_reference_for_every_switch(
    variant_runtime: Runtime, choice: dict[str, Any], margin: tuple[int, int]
) -> None:
    gbuffer = view_of("bumpy", size=(31, 39), margin=margin)
    found = bent(gbuffer, runtime=variant_runtime, **choice)
    wanted = bent_reference(gbuffer, GtaoParams(radius=RADIUS, **choice))
    # A flip spreads over the window of the blur.
    assert share_off(found, wanted) <= 25 * FLIPS


def test_deeper_layers_bend_too(runtime: Runtime) -> None:
    front = view_of("corner")
    made = front.camera
    ball = Ball(made.position - 1.7 * made.view[2, :3], 0.2)
    before = trace(made, [ball])
    depth = np.minimum(np.asarray(front.depth), before.depth)
    deeper = np.where(np.isfinite(before.depth), front.depth, np.inf)
    normal = np.where(np.isfinite(before.depth)[..., None], normal_of(before), normal_of(front))
    both = GBuffer(camera=made, depth=np.stack([depth, deeper]), normal=normal)
    single = GBuffer(camera=made, depth=depth, normal=normal)
    found = bent(both, blur_radius=0, runtime=runtime)
    wanted = bent_reference(both, GtaoParams(radius=RADIUS, blur_radius=0))
    assert share_off(found, wanted) <= FLIPS
    # The ball is out of the radius of what it hides, a corner.
    assert degrees(found, bent(single, blur_radius=0, runtime=runtime)).max() > 2.0


# ---- what must hold for any input


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("resolution", ["full", "half"])
def test_planes_keep_their_normals_at_any_tilt(variant_runtime: Runtime, kind: str, resolution: str) -> None:
    made = camera(kind, (17, 31))
    for tilt in (0.0, 45.0, 85.0, 89.9):
        gbuffer = trace(made, [tilted(made, tilt)])
        found = bent(gbuffer, 1.0, resolution=resolution, runtime=variant_runtime)
        # Nothing is hidden: the normal itself, turned to view space and back.
        np.testing.assert_allclose(found, normal_of(gbuffer), rtol=0, atol=3e-7)


def test_open_surfaces_keep_their_normals_when_blurred(runtime: Runtime) -> None:
    made = camera()
    gbuffer = trace(made, [Ball((0.2, 0.4, -0.3), 1.0)])
    found = bent(gbuffer, resolution="half", runtime=runtime)
    # A ball hides nothing from itself; bends are blurred, normals are not.
    np.testing.assert_allclose(found, normal_of(gbuffer), rtol=0, atol=3e-7)


@pytest.mark.parametrize("choice", [{}, {"falloff": 0.5, "resolution": "half"}], ids=str)
def test_bent_normals_are_units_above_the_surface_and_0_where_nothing_is(
    variant_runtime: Runtime, rng: np.random.Generator, choice: dict[str, Any]
) -> None:
    made = camera(size=(33, 70))
    for reach in (0.3, 3.0, 37.0):
        depth = 10.0 ** rng.uniform(-reach, reach, made.size)
        depth[rng.random(made.size) < 0.1] = np.inf
        gbuffer = GBuffer(camera=made, depth=depth.astype(np.float32))
        for radius in (1e-20, 1.0, 1e20):
            found = bent(gbuffer, radius, runtime=variant_runtime, **choice)
            length = np.linalg.norm(found, axis=-1)
            np.testing.assert_array_equal(length[np.isinf(depth)], 0.0)
            np.testing.assert_allclose(length[np.isfinite(depth)], 1.0, rtol=0, atol=1e-6)


@pytest.mark.parametrize("taps", [{}, pytest.param({"slices": 1, "taps": 3}, marks=pytest.mark.slow)], ids=str)
def test_bent_normals_never_lie_below_the_surface(runtime: Runtime, taps: dict[str, int]) -> None:
    gbuffer = view_of("bumpy")
    found = bent(gbuffer, 3.0, **taps, blur_radius=0, runtime=runtime)
    assert np.sum(found * normal_of(gbuffer), axis=-1)[np.isfinite(gbuffer.depth)].min() > 0.0


def test_visibility_is_the_same_with_and_without(variant_runtime: Runtime) -> None:
    gbuffer = view_of("bumpy")
    for falloff in (0.0, 0.6):
        a, _ = gtao(gbuffer, RADIUS, falloff=falloff, resolution="half", bent_normals=True, runtime=variant_runtime)
        plain = gtao(gbuffer, RADIUS, falloff=falloff, resolution="half", runtime=variant_runtime)
        np.testing.assert_array_equal(a, plain)


def test_prepared_technique_gives_the_same_and_allocates_nothing_more(variant_runtime: Runtime) -> None:
    gbuffer = view_of("bumpy")
    device = uploaded(variant_runtime, gbuffer)
    params = GtaoParams(radius=RADIUS, resolution="half", bent_normals=True)
    technique = Gtao(variant_runtime, gbuffer.size, params)
    first = technique.run(device).download()
    a, found = np.split(check_second_run(variant_runtime, lambda: np.dstack(technique.both(device))), [1], axis=-1)
    np.testing.assert_array_equal(first[0], a[..., 0])
    np.testing.assert_array_equal(np.moveaxis(first[1:], 0, -1), found)
    out = np.zeros(gbuffer.size, np.float32)
    np.testing.assert_array_equal(technique(device, out), first[0])
    np.testing.assert_array_equal(out, first[0])


def test_bad_use_is_refused(runtime: Runtime) -> None:
    gbuffer = view_of("corner", size=(4, 4))
    wrong: Any = "yes"
    with pytest.raises(TypeError, match=r"bent_normals is 'yes': expected True or False"):
        gtao(gbuffer, bent_normals=wrong, runtime=runtime)
    with pytest.raises(ValueError, match=r"bent_normals is False: expected True"):
        Gtao(runtime, (4, 4)).both(gbuffer)
