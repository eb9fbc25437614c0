"""Shadows of deferred shading: against their float64 reference, geometry, and rays."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.reference.direct.shade import shade_reference, shadow_reference, world_surface
from ssgi_cl.techniques.direct.shade import shade

from ..analytic import Plane, camera, scene, trace
from .test_shade import FLIPS, off, white


def boxes(parts: list[tuple[ArrayLike, ArrayLike]], origin: ArrayLike = 0.0) -> Scene:
    """Return axis-aligned boxes of (centre, half extents), with flat normals."""
    positions, normals, triangles = [], [], []
    for centre, half in parts:
        for axis in range(3):
            for sign in (-1.0, 1.0):
                n = np.zeros(3)
                n[axis] = sign
                u, v = np.roll(n, 1) * sign, np.roll(n, 2)
                corners = [n + a * u + b * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
                start = len(positions)
                positions += [np.asarray(centre) + c * np.asarray(half) for c in corners]
                normals += [n] * 4
                triangles += [[start, start + 1, start + 2], [start, start + 2, start + 3]]
    count = len(positions)
    return Scene(
        origin=np.zeros(3) + origin,
        positions=np.array(positions, np.float32),
        normals=np.array(normals, np.float32),
        uvs=np.zeros((count, 2), np.float32),
        colors=np.ones((count, 3), np.float32),
        triangles=np.array(triangles, np.int32),
        material_ids=np.zeros(len(triangles), np.int32),
    )


def shadow_factor(
    gbuffer: GBuffer, light: Light, rsm: ReflectiveShadowMap, runtime: Runtime
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the share of light that the shadow map lets through, and where there is light."""
    full = shade(white(gbuffer), [light], runtime=runtime)[..., 0]
    dimmed = shade(white(gbuffer), [light], shadow_maps=[rsm], runtime=runtime)[..., 0]
    lit = (full > 0) & np.isfinite(np.asarray(gbuffer.depth))
    return np.where(lit, dimmed.astype(np.float64) / np.where(lit, full, 1.0), 1.0), lit


def axes_of(way: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two directions at right angles to an axis-aligned one."""
    axis = int(np.argmax(np.abs(way)))
    return np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]


WAYS = [sign * np.eye(3)[axis] for axis in range(3) for sign in (1.0, -1.0)]
NAMES = ("+x", "-x", "+y", "-y", "+z", "-z")


@pytest.mark.parametrize("name", ["spot", "point", "directional"])
def test_shadow_agrees_with_reference_on_every_kernel_variant(variant_runtime: Runtime, name: str) -> None:
    made = BUILTIN_SCENES["cornell_box"]()
    light = {
        "spot": made.lights[0],
        "point": PointLight((0.28, 0.4, 0.25), 1.0),
        # Through the open front: what the camera looks along, from above.
        "directional": DirectionalLight(-made.camera(4, 3).view[2, :3] + (0.2, -0.3, 0.0), 1.0),
    }[name]
    gbuffer = white(gi.rasterize.gbuffer(made.scene, made.camera(96, 72), runtime=variant_runtime))
    rsm = gi.rasterize.rsm(made.scene, light, size=128, runtime=variant_runtime)
    radiance = shade(gbuffer, [light], shadow_maps=[rsm], runtime=variant_runtime)
    expected = shade_reference(gbuffer, [light], shadow_maps=[rsm])
    # A texel at its limit may count or not; measured: none of 20736 pixels.
    assert off(radiance, expected) <= FLIPS
    assert 0.05 < np.mean(radiance > 0) < 0.95


@pytest.mark.parametrize(
    ("way", "kind"),
    [  # a point light by each face of its map, the others by two
        pytest.param(
            way,
            kind,
            id=f"{kind}-{NAMES[number]}",
            marks=[pytest.mark.slow] * (kind != "point" and number not in (0, 3)),
        )
        for number, way in enumerate(WAYS)
        for kind in ("spot", "point", "directional")
    ],
)
def test_shadow_of_a_half_plane_has_its_edge_where_geometry_puts_it(
    runtime: Runtime, kind: str, way: NDArray[np.float64]
) -> None:
    u, v = axes_of(way)
    shift = 1e6 if way.sum() < 0 else 0.0  # far from the world's origin, too
    # The light shines from 0 along `way`: a wall at 2, a slab from 1 to 1.02 where u . x < 0.103.
    centre = 1.01 * way + u * (0.103 - 2.0)
    half = 0.01 * np.abs(way) + 2.0 * u + 4.0 * v
    made = boxes([(2.1 * way, 0.1 * np.abs(way) + 3.0 * (u + v)), (centre, half)], origin=shift)
    light: Light = {
        "spot": SpotLight(np.full(3, shift), way, 0.5, 1.0),
        "point": PointLight(np.full(3, shift), 1.0),
        "directional": DirectionalLight(way, 1.0),
    }[kind]
    rsm = gi.rasterize.rsm(made, light, size=256, runtime=runtime)  # type: ignore[arg-type]
    viewer = Camera.orthographic(shift + 1.5 * way, shift + 2.0 * way, v, view_height=0.06, width=400, height=12)
    gbuffer = trace(viewer, [Plane(shift + 2.0 * way, -way)])
    factor, lit = shadow_factor(gbuffer, light, rsm, runtime)
    position = viewer.unproject(np.asarray(gbuffer.depth)) - shift
    across = position @ u
    sx, sy, _, _ = rsm.cameras[0].pixel_to_view
    texel = max(abs(sx), abs(sy)) * (1.0 if kind == "directional" else 2.0)
    # Of a slab of thickness 0.02, the side that is nearer to the light throws the edge.
    edge = 0.103 if kind == "directional" else 0.103 * 2.0
    inside = lit & (np.abs(across) < 0.9)
    # The filter reaches 2 texels to either side; the map itself knows the edge to half a texel.
    umbra, open_ = inside & (across < edge - 2.5 * texel), inside & (across > edge + 2.5 * texel)
    assert umbra.any()
    assert open_.any()
    np.testing.assert_array_equal(factor[umbra], 0.0)
    np.testing.assert_array_equal(factor[open_], 1.0)
    # Half the light at the edge, to a texel: the map's own edge is known no better.
    half_lit = inside & (np.abs(factor - 0.5) < 0.2)
    assert np.abs(across[half_lit] - edge).max() < texel + 0.0025


@pytest.mark.parametrize(
    "degrees",
    [
        0.0,
        *(pytest.param(d, marks=pytest.mark.slow) for d in (20.0, 45.0)),
        60.0,
        pytest.param(75.0, marks=pytest.mark.slow),
        85.0,
    ],
)
@pytest.mark.parametrize("kind", ["spot", "point", "directional"])
def test_lit_plane_has_no_false_shadow_at_any_tilt(runtime: Runtime, kind: str, degrees: float) -> None:
    tilt = math.radians(degrees)
    for turn, shift in ((0.0, 0.0), (0.5, 0.0), (2.0, 1e6)):
        n = np.array([math.sin(tilt) * math.cos(turn), math.cos(tilt), math.sin(tilt) * math.sin(turn)])
        u = np.cross(n, [0.3, 0.2, 0.9])
        u /= np.linalg.norm(u)
        v = np.cross(n, u)
        corners = np.array([a * u + b * v for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
        made = Scene(
            origin=np.full(3, shift),
            positions=corners.astype(np.float32),
            normals=np.tile(n, (4, 1)).astype(np.float32),
            uvs=np.zeros((4, 2), np.float32),
            colors=np.ones((4, 3), np.float32),
            triangles=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
            material_ids=np.zeros(2, np.int32),
        )
        light: Light = {
            "spot": SpotLight((shift, shift + 3.0, shift), (0, -1, 0), 0.6, 1.0),
            "point": PointLight((shift, shift + 3.0, shift), 1.0),
            "directional": DirectionalLight((0, -1, 0), 1.0),
        }[kind]
        rsm = gi.rasterize.rsm(made, light, size=256, runtime=runtime)  # type: ignore[arg-type]
        viewer = Camera.look_at(shift + 4.0 * n + 0.5 * u, np.full(3, shift), v, yfov=0.5, width=120, height=90)
        gbuffer = gi.rasterize.gbuffer(made, viewer, runtime=runtime)
        factor, lit = shadow_factor(gbuffer, light, rsm, runtime)
        assert lit.mean() > 0.5
        np.testing.assert_array_equal(factor[lit], 1.0, err_msg=f"turn {turn}")


def test_smooth_ball_of_flat_triangles_shadows_only_its_far_side(runtime: Runtime) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.icosphere(subdivisions=4)
    made = gi.rasterize.load_scene(mesh)
    smooth = replace(
        made, normals=(made.positions / np.linalg.norm(made.positions, axis=1, keepdims=True)).astype(np.float32)
    )
    light = DirectionalLight((-0.3, -1.0, -0.2), 1.0)
    rsm = gi.rasterize.rsm(smooth, light, size=512, runtime=runtime)
    viewer = Camera.look_at((2, 3, 3), (0, 0, 0), width=200, height=150)
    gbuffer = gi.rasterize.gbuffer(smooth, viewer, runtime=runtime)
    factor, _ = shadow_factor(gbuffer, light, rsm, runtime)
    _, normal, there = world_surface(gbuffer)
    cosine = -normal @ np.asarray(light.direction)
    # Edges of 2^-4 rad turn by 4 degrees: flat triangles face away 4 degrees before normals do.
    facing = there & (cosine > math.sin(math.radians(6.0)))
    assert np.mean(factor[facing] < 1.0) < 1e-3


def test_no_dark_line_runs_along_a_lit_inner_edge(runtime: Runtime) -> None:
    # A floor and two walls under a light that reaches all of them.
    walls = [((-1.1, 1, 0), (0.1, 1, 2)), ((0, 1, -1.1), (2, 1, 0.1))]
    room = boxes([((0, -0.1, 0), (2, 0.1, 2)), *walls])
    light = PointLight((0.2, 1.2, 0.3), 1.0)
    rsm = gi.rasterize.rsm(room, light, size=512, runtime=runtime)
    viewer = Camera.look_at((0.6, 0.9, 0.7), (-1.0, 0.0, -1.0), width=240, height=180)
    gbuffer = gi.rasterize.gbuffer(room, viewer, runtime=runtime)
    factor, lit = shadow_factor(gbuffer, light, rsm, runtime)
    # All is lit. A filter that compares with the tangent plane alone darkens 0.6 % of the pixels.
    assert np.mean(factor[lit] < 1.0) < 1e-3


def rays_of(scene_: Scene) -> Any:
    """Return Embree's scene of the triangles, or skip."""
    embree = pytest.importorskip("embreex.rtcore_scene", reason="embreex is not installed")
    from embreex.mesh_construction import TriangleMesh

    made = embree.EmbreeScene()
    corners = (scene_.positions.astype(np.float64) + scene_.origin)[scene_.triangles]
    TriangleMesh(made, np.ascontiguousarray(corners.astype(np.float32)))
    return made


def lit_by_ray(
    rays: Any, light: Light, position: NDArray[np.float64], off_surface: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return whether the way from points to the light is free."""
    start = position + off_surface
    if isinstance(light, DirectionalLight):
        way = np.broadcast_to(-np.asarray(light.direction), start.shape)
        length = np.full(len(start), 1e3)
    else:
        assert isinstance(light, (SpotLight, PointLight))
        to_light = np.asarray(light.position) - start
        length = np.linalg.norm(to_light, axis=-1)
        way = to_light / length[:, None]
        length = length * (1.0 - 1e-3)
    hit = rays.run(start.astype(np.float32), way.astype(np.float32), dists=length.astype(np.float32), query="OCCLUDED")
    return np.asarray(hit) < 0


BUILTIN_LIGHTS = [
    ("cornell_box", 0, "own"),
    pytest.param("cornell_box", 0, "point", marks=pytest.mark.slow),
    pytest.param("hall", 0, "own", marks=pytest.mark.slow),
    pytest.param("hall", 2, "own", marks=pytest.mark.slow),
    pytest.param("hall", 2, "point", marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("name", "index", "kind"), BUILTIN_LIGHTS)
def test_shadow_is_that_of_rays_away_from_shadow_edges(runtime: Runtime, name: str, index: int, kind: str) -> None:
    built = BUILTIN_SCENES[name]()
    light = built.lights[index]
    assert not isinstance(light, Environment)
    if kind == "point":
        assert isinstance(light, SpotLight)
        light = PointLight(light.position, 1.0)
    rays = rays_of(built.scene)
    extent = float(np.linalg.norm(np.ptp(built.scene.bounds, axis=0)))
    rsm = gi.rasterize.rsm(built.scene, light, size=1024, runtime=runtime)
    gbuffer = gi.rasterize.gbuffer(built.scene, built.camera(120, 90), runtime=runtime)
    factor, lit = shadow_factor(gbuffer, light, rsm, runtime)
    position, normal, _ = world_surface(gbuffer)
    point, normal = position[lit], normal[lit]
    off_surface = 1e-4 * extent * normal
    sx, sy, _, _ = rsm.cameras[0].pixel_to_view
    if isinstance(light, DirectionalLight):
        toward = np.broadcast_to(-np.asarray(light.direction), point.shape)
        texel = np.full(len(point), max(abs(sx), abs(sy)))
    else:
        to_light = np.asarray(light.position) - point
        distance = np.linalg.norm(to_light, axis=-1)
        toward = to_light / distance[:, None]
        texel = distance * abs(sx) * 1.7  # at a cube's corner a texel is that much wider
    truth = lit_by_ray(rays, light, point, off_surface)
    # A shadow edge is near where the ray to any texel of the filter, met on the tangent plane, has
    # another answer: 3.5 texels any way along the map's axes, 4.2 along these.
    a = np.cross(toward, [0.3, 0.9, 0.2])
    a /= np.linalg.norm(a, axis=-1, keepdims=True)
    b = np.cross(toward, a)
    facing = np.maximum(np.sum(normal * toward, axis=-1), 0.02)
    away = np.ones(len(point), bool)
    for i in np.linspace(-4.2, 4.2, 13):
        for j in np.linspace(-4.2, 4.2, 13):
            aside = (i * a + j * b) * texel[:, None]
            up = -np.sum(aside * normal, axis=-1) / facing
            there = point + aside + up[:, None] * toward
            away &= lit_by_ray(rays, light, there, off_surface) == truth
    wrong = away & (np.abs(factor[lit] - truth) > 1e-3)
    assert away.mean() > 0.4
    # At 400 x 300 pixels: 0 in the Cornell box and under the hall's light, 0.3 % in the sun, all of
    # it light through window bars thinner than the map's texels.
    assert wrong.sum() / away.sum() < 5e-3
    assert (wrong & truth).sum() / away.sum() < 1e-3  # acne


def test_shadow_of_a_spot_reaches_no_further_than_its_map(runtime: Runtime) -> None:
    slab = boxes([((0, -0.1, 0), (3, 0.1, 3))])
    light = SpotLight((0, 2, 0), (0, -1, 0), 0.5, 1.0)
    made = Camera.orthographic((0, 5, 0), (0, 0, 0), (0, 0, 1), view_height=4, width=80, height=80)
    gbuffer = gi.rasterize.gbuffer(slab, made, runtime=runtime)
    for size in (1, 2, 3, 16):
        rsm = gi.rasterize.rsm(slab, light, size=size, runtime=runtime)
        factor, lit = shadow_factor(gbuffer, light, rsm, runtime)
        np.testing.assert_array_equal(factor[lit], 1.0)


def test_lights_without_a_map_cast_no_shadow(runtime: Runtime) -> None:
    made = BUILTIN_SCENES["cornell_box"]()
    gbuffer = gi.rasterize.gbuffer(made.scene, made.camera(48, 36), runtime=runtime)
    punctual_lights = (made.lights[0], PointLight((0.2, 0.3, 0.1), 1.0))
    maps = [None, gi.rasterize.rsm(made.scene, punctual_lights[1], size=64, runtime=runtime)]
    both = shade(gbuffer, punctual_lights, shadow_maps=maps, runtime=runtime)
    expected = shade_reference(gbuffer, punctual_lights, shadow_maps=maps)
    assert off(both, expected) <= FLIPS


def test_reference_of_the_shadow_is_open_where_the_map_is_empty(rng: np.random.Generator) -> None:
    made = camera(size=(9, 11))
    position, normal, _ = world_surface(scene("corner", made, rng))
    square = Camera.look_at((0, 3, 0.1), (0, 0, 0), width=8, height=8)
    empty = ReflectiveShadowMap(
        light=SpotLight((0, 3, 0.1), (0, -1, 0), 0.4, 1.0),
        camera=square,
        depth=np.full((8, 8), np.inf),
        position=np.zeros((8, 8, 3)),
        normal=np.zeros((8, 8, 3)),
        flux=np.zeros((8, 8, 3)),
    )
    np.testing.assert_array_equal(shadow_reference(empty, position, normal), 1.0)


def test_light_inside_a_solid_does_not_light_its_outside(runtime: Runtime) -> None:
    box = boxes([((0.0, 0.5, 0.0), (0.5, 0.5, 0.5)), ((0.0, -0.1, 0.0), (4.0, 0.1, 4.0))])
    made = Camera.look_at((2, 2, 3), (0, 0.4, 0), width=64, height=48)
    gbuffer = white(gi.rasterize.gbuffer(box, made, runtime=runtime))
    light = PointLight((0.1, 0.4, 0.0), 1.0)
    rsm = gi.rasterize.rsm(box, light, size=256, runtime=runtime)
    radiance = shade(gbuffer, [light], shadow_maps=[rsm], runtime=runtime)
    position, _, there = world_surface(gbuffer)
    # Away from the box's contact with the floor: the filter's outer texels are taken along the
    # floor, 2.5 texels of 0.01 units, and what is nearer by as much does not shadow them.
    floor = np.abs(position[..., [0, 2]]).max(axis=-1) > 0.58
    outside = there & (floor | (position[..., 1] > 0.05))
    np.testing.assert_array_equal(radiance[outside], 0.0)
