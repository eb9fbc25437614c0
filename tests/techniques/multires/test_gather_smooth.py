"""What rays find at points, smoothed over their neighbours."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.gbuffer import SurfaceView, view_normals
from ssgi_cl.reference.multires.gather_smooth import gather_smooth_reference
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.radiosity.even_light import EvenLight
from ssgi_cl.techniques.radiosity.light_volume import CELLS, FACES

from ...frame.scenes import cube, halves, inside, matt, scene_of
from .test_final_gather import volume_of

Doubles = NDArray[np.float64]


def one_lit(rng: np.random.Generator) -> EvenLight:
    """The light of a room whose floor shines more than its other sides."""
    radiance = rng.uniform(0.0, 0.2, (CELLS, CELLS, CELLS, FACES, 3))
    radiance[..., 2, :] += 1.0
    return EvenLight(volume_of(radiance, np.ones((CELLS, CELLS, CELLS, FACES))), None)


def gathered(
    runtime: Runtime, scene: gi.Scene, camera: gi.Camera, light: EvenLight, rays: int, step: int, number: int = 0
) -> tuple[gi.GBuffer, Doubles, Doubles]:
    """Return what is seen at the points, what rays find there, with the mean of 1 / distance and their number, and what
    is smoothed.

    Points are those of level `number`; with the second level all are computed that the first has not.
    """
    seen = gi.rasterize.gbuffer(scene, camera, runtime=runtime)
    params = MultiresSplatParams(
        vpls=1, visibility=True, grid=32, coarsest=step << number, interpolation_error=0.0 if number else 0.01
    )
    technique = MultiresSplat(runtime, seen.size, params, surfels=64, rays=rays)
    with runtime.frame():
        technique.run(on_device(seen, runtime), blockers=scene, even=light)
        level = technique.grid._levels[number]
        assert technique._final is not None
        found = np.moveaxis(technique._final._found[number].download(), 0, -1).astype(np.float64)
        smooth = np.moveaxis(level.values.download(), 0, -1).astype(np.float64)
    return seen, found, smooth


def points_of(seen: gi.GBuffer, camera: gi.Camera, step: int) -> tuple[Doubles, Doubles]:
    """Return places in world space, infinite where nothing is, and normals in view space, of every so-many-th pixel."""
    depth = np.asarray(seen.depth, np.float64)
    place = np.full((*depth.shape, 3), math.inf)
    there = np.isfinite(depth)
    place[there] = camera.unproject(np.where(there, depth, 1.0).astype(np.float32))[there]
    normal = view_normals(SurfaceView.of(seen), seen.first("normal")).astype(np.float64)
    return place[::step, ::step], normal[::step, ::step] @ camera.view[:3, :3]


@pytest.mark.parametrize(("width", "number"), [(61, 0), (2, 0), (61, 1)])
def test_the_fit_is_that_of_float64(
    variant_runtime: Runtime, rng: np.random.Generator, width: int, number: int
) -> None:
    """Of the second level, that of points which are not interpolated, though those of the first count for them."""
    # A room with a column of 24 sides in it, outside of which nothing is seen in part: neighbours on the same plane,
    # turned a little and a lot, off the plane, and missing ones.
    room = cube(0.5)
    turn = np.linspace(0.0, 2.0 * math.pi, 25)[:-1]
    ring = np.stack([0.6 * np.cos(turn) - 0.2, np.zeros(24), 0.6 * np.sin(turn) - 0.3], axis=1)
    column = np.concatenate([ring - np.array((0.0, 0.9, 0.0)), ring + np.array((0.0, 0.5, 0.0))])
    sides = [(i, (i + 1) % 24, (i + 1) % 24 + 24, i + 24) for i in range(24)]
    scene = scene_of(
        np.concatenate([np.asarray(room.positions, np.float64), column]),
        [*np.asarray(room.triangles)[2:].tolist(), *(np.array(halves(sides)) + len(room.positions)).tolist()],
        matt(0.5),
    )
    camera = gi.Camera.look_at((0.7, 0.3, 0.9), (-0.3, -0.2, -0.6), yfov=1.2, width=width, height=45)
    seen, found, smooth = gathered(variant_runtime, scene, camera, one_lit(rng), 16, 4, number)
    place, normal = points_of(seen, camera, 4)
    own = np.ones(place.shape[:2], np.bool_)
    if number:
        own[::2, ::2] = False
        assert found[::2, ::2, 4].max() > 2.0 * found[own][:, 4].max() > 0.0  # of the first level: more rays each
    # `near` is in 1 / lengths of receivers: those of the view space, times a power of two that the furthest corner
    # gives. It is found from a ray's own distances: of the mean of 1 / distance in scene units.
    scale = 2.0 ** np.arange(-8, 9)
    fits = [gather_smooth_reference(place, normal, found[..., :3], found[..., 3] * s, found[..., 4]) for s in scale]
    off = [np.abs(fit - smooth)[own].max() for fit in fits]
    assert min(off) < 2e-5
    if width > 2:
        assert np.abs(found[..., :3] - smooth)[own].max() > 0.05  # they do change
        assert sorted(off)[1] > 1e-3  # one scale alone fits


def test_levels_have_what_coarser_ones_found(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    # 6 x 4, 11 x 8, 22 x 16 and 43 x 31 points: last columns and rows that coarser levels have, and have not.
    seen = gi.rasterize.gbuffer(cube(0.5), inside(86, 62), runtime=variant_runtime)
    technique = MultiresSplat(
        variant_runtime, seen.size, MultiresSplatParams(vpls=1, visibility=True, grid=32), surfels=64, rays=64
    )
    with variant_runtime.frame():
        technique.run(on_device(seen, variant_runtime), blockers=cube(0.5), even=one_lit(rng))
        assert technique._final is not None
        found = {number: np.array(plane.download()) for number, plane in technique._final._found.items()}
        lists = [level.listed() for level in technique.grid._levels]
    assert len(found) == 4
    for number in range(1, len(found)):
        own = np.zeros(found[number].shape[1:], np.bool_)
        own[tuple(lists[number].T)] = True
        nested = np.zeros_like(own)
        nested[::2, ::2] = True
        assert own.any()
        assert not (own & nested).any()
        np.testing.assert_array_equal(found[number][:, ::2, ::2], found[number - 1])
        np.testing.assert_array_equal(found[number][4][~nested] > 0.0, own[~nested])


def test_noise_of_walls_is_less(runtime: Runtime, rng: np.random.Generator) -> None:
    camera = gi.Camera.look_at((0.0, 0.0, 0.9), (0.0, 0.0, -1.0), yfov=1.2, width=96, height=96)
    light = one_lit(rng)
    _, found, smooth = gathered(runtime, cube(0.5), camera, light, 16, 2)
    _, truth, _ = gathered(runtime, cube(0.5), camera, light, 1600, 2)
    wall = (slice(14, 34), slice(14, 34))
    raw = (found[wall] - truth[wall])[..., :3]
    left = smooth[wall] - truth[wall][..., :3]
    # 25 samples of equal weight would leave a fifth; weights fall with distance, and the truth has noise of its own.
    assert left.std() < 0.45 * raw.std()
    assert abs(left.mean()) < 0.3 * raw.std() / math.sqrt(raw[..., 0].size) * 5.0


def test_a_room_of_one_radiance_stays_so(variant_runtime: Runtime) -> None:
    # Sums of weights of either sign, rounded to float32.
    even = EvenLight(volume_of(np.ones((CELLS, CELLS, CELLS, FACES, 3)), np.ones((CELLS, CELLS, CELLS, FACES))), None)
    _, _, smooth = gathered(variant_runtime, cube(0.5), inside(40, 36), even, 16, 4)
    np.testing.assert_allclose(smooth, math.pi, rtol=3e-6)
