"""Emissive surfaces: polygons in closed form, shadows against rays to many points, and hostile emitters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import ArrayLike, NDArray

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.reference.area_lights.area_lights import area_lights_reference, blocked, polygon_irradiance
from ssgi_cl.reference.gbuffer import SurfaceView
from ssgi_cl.techniques.area_lights.emitters import MOST, Emitters

from ..vpl.given import uploaded

Doubles = NDArray[np.float64]
Quad = tuple[Sequence[float], Sequence[float], Sequence[float]]

FLOOR: Quad = ((-2, 0, -2), (0, 0, 4), (4, 0, 0))
WALL: Quad = ((-2, 0, -2), (4, 0, 0), (0, 3, 0))
PANEL: Quad = ((-0.4, 2, -0.6), (0.8, 0, 0), (0, 0, 0.8))  # its front is below
TABLE: Quad = ((-0.9, 0.8, -0.8), (0, 0, 1.1), (1.2, 0, 0))
LIGHT = (3.0, 2.0, 1.0)


def scene_of(
    parts: Sequence[tuple[Quad, Material]],
    *,
    origin: ArrayLike = (0, 0, 0),
    mesh: Any = None,
    of_mesh: Material | None = None,
) -> Scene:
    """Parallelograms, each a corner and two edges, and a mesh."""
    points, faces, ids = [], [], []
    for number, (part, _) in enumerate(parts):
        corner, first, second = (np.asarray(p, np.float64) for p in part)
        faces += [[len(points) + k for k in t] for t in ((0, 1, 2), (0, 2, 3))]
        points += [corner, corner + first, corner + first + second, corner + second]
        ids += [number, number]
    materials = [material for _, material in parts]
    if mesh is not None:
        faces += (mesh.faces + len(points)).tolist()
        points += list(mesh.vertices)
        ids += [len(materials)] * len(mesh.faces)
        materials.append(of_mesh or Material())
    count = len(points)
    return Scene(
        origin=np.asarray(origin, np.float64),
        positions=np.array(points, np.float32),
        normals=np.zeros((count, 3), np.float32),
        uvs=np.zeros((count, 2), np.float32),
        colors=np.ones((count, 3), np.float32),
        triangles=np.array(faces, np.int32),
        material_ids=np.array(ids, np.int32),
        materials=tuple(materials),
    )


def area_light(emission: ArrayLike = LIGHT, **given: Any) -> Material:
    values = [float(v) for v in np.broadcast_to(emission, 3)]
    return Material(emission=(values[0], values[1], values[2]), double_sided=False, **given)


MATT = Material()
ROOM = [(FLOOR, MATT), (WALL, MATT), (PANEL, area_light())]


def camera_of(kind: str = "perspective", origin: ArrayLike = (0, 0, 0)) -> Camera:
    eye, target = np.array([1.6, 1.7, 3.4]) + origin, np.array([0.0, 0.6, -0.6]) + origin
    if kind == "orthographic":
        return Camera.orthographic(eye, target, view_height=4.0, width=71, height=52)
    return Camera.look_at(eye, target, (0, 1, 0), yfov=0.9, width=71, height=52)


def lit(runtime: Runtime, scene: Scene, camera: Camera | None = None, overscan: float = 0.0, **given: Any) -> Doubles:
    """Irradiance by the technique."""
    seen = drawn(scene, camera or camera_of(), overscan=overscan, runtime=runtime)
    return gi.area_lights(seen, scene=scene, runtime=runtime, **given).astype(np.float64)


def receivers(seen: gi.GBuffer, scene: Scene) -> tuple[Doubles, Doubles, NDArray[np.bool_]]:
    """Positions and normals [n, 3] of the pixels that show something, and [rows, columns] where that is."""
    position, normal, there = SurfaceView.of(seen).in_scene(scene.origin)
    return position[there], normal[there], there


def test_a_rectangle_overhead_has_the_form_factor_of_the_books() -> None:
    # Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", B-5: an element parallel
    # to a rectangle, under its corner.
    a, b, c = 1.3, 0.7, 0.9
    x, y = a / c, b / c
    root_x, root_y = math.hypot(1, x), math.hypot(1, y)
    factor = (x / root_x * math.atan(y / root_x) + y / root_y * math.atan(x / root_y)) / (2 * math.pi)
    corners = np.array([(0, c, 0), (a, c, 0), (a, c, b), (0, c, b)], np.float64)
    found = polygon_irradiance(corners, np.zeros(3), np.array([0.0, 1.0, 0.0]))
    assert found == pytest.approx(math.pi * factor, rel=1e-12)
    assert polygon_irradiance(corners[::-1], np.zeros(3), np.array([0.0, 1.0, 0.0])) == pytest.approx(-found, rel=1e-12)


def test_what_is_below_the_horizon_does_not_count(rng: np.random.Generator) -> None:
    corners = np.array([(0.5, -1, -1), (0.5, -0.4, 1.2), (0.5, 1, 1), (0.5, 0.8, -1)], np.float64)
    normals = rng.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    found = polygon_irradiance(corners, np.zeros((200, 3)), normals)
    u, v = (np.arange(400) + 0.5) / 400, (np.arange(400) + 0.5) / 400
    total = np.zeros(200)
    for a, b, c in (corners[[0, 1, 2]], corners[[0, 2, 3]]):
        s, t = np.meshgrid(1 - np.sqrt(u), v)
        points = (a + s[..., None] * (b - a) + ((1 - s) * t)[..., None] * (c - a)).reshape(-1, 3)
        double = np.cross(b - a, c - a)
        squared = (points**2).sum(axis=1)
        weight = -(points @ double) / squared**2 / (2 * u.size * v.size)
        total += np.maximum(normals @ points.T, 0.0) @ weight
    # Midpoint rule of 160,000 points; terms of the horizon's cut cells are off by half of themselves.
    np.testing.assert_allclose(found, total, atol=2e-5 * np.abs(total).max() + 1e-5)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize("origin", [(0, 0, 0), (4000.0, -300.0, 70.0)])
def test_light_that_nothing_blocks_is_that_of_the_polygon(runtime: Runtime, kind: str, origin: ArrayLike) -> None:
    # The horizon of the ramp goes through the panel.
    ramp = ((-2.0, 0.0, -1.9), (0.0, 0.0, 3.8), (0.5, 0.5, 0.0))
    scene = scene_of([*ROOM, (ramp, MATT)], origin=origin)
    camera = camera_of(kind, origin)
    seen = drawn(scene, camera, runtime=runtime)
    at, normal, there = receivers(seen, scene)
    corner, first, second = (np.asarray(p, np.float64) for p in PANEL)
    corners = np.array([corner, corner + first, corner + first + second, corner + second])
    right = np.zeros((*seen.size, 3))
    right[there] = (
        (at[:, 1] < 1.9994)[:, None] * np.maximum(polygon_irradiance(corners, at, normal), 0.0)[:, None] * LIGHT
    )
    found = lit(runtime, scene, camera)
    on_ramp = np.zeros(seen.size, bool)
    on_ramp[there] = (np.abs(at[:, 1] - at[:, 0] - 2.0) < 1e-3) & (at[:, 0] > -1.99)
    behind = np.zeros(seen.size, bool)  # the ramp may be in its way
    behind[there] = (at[:, 0] < -1.4) & (at[:, 1] < 1.0)
    # Where planes meet normals are of neither, and the plane that is there blocks light.
    facing = np.array([(0, 1, 0), (0, -1, 0), (0, 0, 1), (math.sqrt(0.5), -math.sqrt(0.5), 0)])
    flat = np.zeros(seen.size, bool)
    flat[there] = (normal @ facing.T).max(axis=1) > 1.0 - 1e-6
    on_ramp &= flat
    known = flat & (on_ramp | ~behind)
    assert np.count_nonzero(on_ramp & (right[..., 0] > 0.002)) > 10
    # float32, of angles down to .01 from cross products of lengths of 3; depth is off by 1e-6 of itself.
    np.testing.assert_allclose(found[known], right[known], atol=2e-4 * right.max())
    assert np.count_nonzero(right[..., 0] > 0.1 * right.max()) > 1000


def test_shadows_are_those_of_rays_to_many_points(runtime: Runtime) -> None:
    scene = scene_of([*ROOM, (TABLE, MATT)])
    camera = camera_of()
    right = area_lights_reference(drawn(scene, camera, runtime=runtime), scene, side=16)
    many = lit(runtime, scene, camera, rays=16, more_rays=16, blur=0)
    default = lit(runtime, scene, camera)
    bright = right.max()
    assert np.mean(right[..., 0] < 1e-3 * bright) > 0.01  # there is an umbra
    # 32 points against 512: in penumbrae .1 of what arrives at most, a sixth of the pixels.
    assert np.sqrt(np.mean((many - right) ** 2)) < 0.012 * bright
    assert abs(many.mean() - right.mean()) < 2e-3 * right.mean()
    # Five, and a blur of penumbrae that are as narrow as 2 pixels in so small an image.
    assert np.sqrt(np.mean((default - right) ** 2)) < 0.02 * bright
    assert abs(default.mean() - right.mean()) < 5e-3 * right.mean()
    umbra = right[..., 0] == 0.0
    assert np.percentile(default[umbra], 90) <= 0.01 * bright


def test_the_table_stands_in_its_own_light_and_its_shadow_ends_at_its_feet(runtime: Runtime) -> None:
    legs = trimesh.creation.box(extents=(0.5, 0.8, 0.5))
    legs.apply_translation((0, 0.4, 0))
    scene = scene_of(ROOM, mesh=legs)
    found = lit(runtime, scene)
    right = area_lights_reference(drawn(scene, camera_of(), runtime=runtime), scene, side=12)
    error = np.abs(found - right)[..., 0] / right.max()
    assert np.percentile(error, 95) < 0.04
    assert np.percentile(error, 80) < 0.012


@pytest.mark.parametrize("double_sided", [False, True])
def test_a_lamp_seen_from_behind_is_dark_unless_it_has_two_sides(runtime: Runtime, double_sided: bool) -> None:
    corner, first, second = PANEL
    material = Material(emission=LIGHT, double_sided=double_sided)
    scene = scene_of([(FLOOR, MATT), ((corner, second, first), material)])  # its front is above
    found = lit(runtime, scene)
    facing = lit(runtime, scene_of([(FLOOR, MATT), (PANEL, material)]))
    assert facing.max() > 0.4
    if double_sided:
        np.testing.assert_allclose(found, facing, atol=0.02 * facing.max())
    else:
        assert not found.any()


def test_lamps_of_several_colours_keep_them_in_each_other_s_shadow(runtime: Runtime) -> None:
    red, blue = area_light((4, 0, 0)), area_light((0, 0, 2))
    parts = [(FLOOR, MATT), (TABLE, MATT), (PANEL, red), (((-1.8, 0.2, 1.0), (0, 0.6, 0), (0.0, 0.0, 0.6)), blue)]
    scene = scene_of(parts)
    assert Emitters.of(scene).channels == 3
    right = area_lights_reference(drawn(scene, camera_of(), runtime=runtime), scene, side=12)
    found = lit(runtime, scene, more_rays=16, rays=4)
    assert not found[..., 1].any()
    for channel in (0, 2):
        assert right[..., channel].max() > 0.2
        error = np.abs(found - right)[..., channel]
        assert np.sqrt(np.mean(error**2)) < 0.035 * right[..., channel].max()


def test_an_emissive_mesh_of_thousands_of_triangles_is_a_few_rectangles(runtime: Runtime) -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.3)
    ball.apply_translation((0, 1.4, 0))
    assert len(ball.faces) > 20_000
    scene = scene_of([(FLOOR, MATT), (WALL, MATT)], mesh=ball, of_mesh=area_light((1, 1, 1)))
    assert len(Emitters.of(scene)) == MOST
    seen = drawn(scene, camera_of(), runtime=runtime)
    at, normal, there = receivers(seen, scene)
    found = gi.area_lights(seen, scene=scene, runtime=runtime)[there][:, 0]
    # A ball of even radiance, all of it over the horizon: pi (r / d)^2 cos.
    way = np.array([0, 1.4, 0]) - at
    far = np.linalg.norm(way, axis=1)
    right = math.pi * (0.3 / far) ** 2 * (way * normal).sum(axis=1) / far
    whole = ((way * normal).sum(axis=1) > 0.31) & (far > 0.6)
    assert np.count_nonzero(whole) > 1000
    error = found[whole] / right[whole] - 1.0
    # Rectangles in place of caps of the ball.
    assert abs(error.mean()) < 0.05
    assert np.percentile(np.abs(error), 95) < 0.2


def test_light_is_proportional_to_radiance_up_to_its_greatest(runtime: Runtime) -> None:
    base = lit(runtime, scene_of(ROOM))
    for factor in (1e-12, 1e9, 1e20):
        bright = scene_of([(FLOOR, MATT), (WALL, MATT), (PANEL, area_light(np.multiply(LIGHT, factor)))])
        np.testing.assert_allclose(lit(runtime, bright) / factor, base, rtol=1e-4, atol=1e-6)
    greatest = lit(runtime, scene_of([(FLOOR, MATT), (PANEL, area_light(1e30))]))
    assert np.isfinite(greatest).all()


def test_emitters_without_area_or_with_holes_in_their_numbers_send_nothing(runtime: Runtime) -> None:
    corner, first, _ = PANEL
    flat = scene_of(
        [(FLOOR, MATT), ((corner, first, first), area_light()), ((corner, (0, 0, 0), (0, 0, 0)), area_light())]
    )
    assert len(Emitters.of(flat)) == 0
    assert not lit(runtime, flat).any()
    assert not lit(runtime, scene_of([(FLOOR, MATT)])).any()


def test_a_lamp_inside_a_box_lights_nothing_outside(runtime: Runtime) -> None:
    box = trimesh.creation.box(extents=(1.2, 0.5, 1.2))
    box.apply_translation((0, 2, 0))
    scene = scene_of(ROOM, mesh=box)
    assert not lit(runtime, scene).any()


def test_a_lamp_that_fills_the_view_gives_pi_times_its_radiance(runtime: Runtime) -> None:
    near = ((-500.0, 0.2, -500.0), (1000.0, 0, 0), (0, 0, 1000.0))
    scene = scene_of([(((-1, 0, -1), (0, 0, 2), (2, 0, 0)), MATT), (near, area_light(1.0))])
    camera = Camera.look_at((0, 0.15, 0), (0, 0, 0), (0, 0, 1), yfov=1.0, width=33, height=20)
    # What lies beyond 500 of .2 sees less than 1e-6 of the hemisphere.
    np.testing.assert_allclose(lit(runtime, scene, camera), math.pi, rtol=1e-3)


def test_textured_emission_sends_that_of_its_mean(runtime: Runtime) -> None:
    checks = np.zeros((2, 2, 4), np.uint8)
    checks[..., 3] = 255
    checks[0, 0, :3] = checks[1, 1, :3] = 255
    scene = scene_of(ROOM)
    textured = Scene(
        origin=scene.origin, positions=scene.positions, normals=scene.normals, uvs=scene.uvs, colors=scene.colors,
        triangles=scene.triangles, material_ids=scene.material_ids, textures=(checks,),
        materials=(MATT, MATT, area_light(emission_texture=0)),
    )  # fmt: skip
    np.testing.assert_allclose(lit(runtime, textured), 0.5 * lit(runtime, scene), rtol=1e-5, atol=1e-6)


def test_light_passes_the_holes_that_alpha_cuts_out(runtime: Runtime) -> None:
    sheet = ((-1.5, 1.2, -1.5), (0, 0, 3), (3, 0, 0))
    texels = np.full((16, 16, 4), 255, np.uint8)
    texels[:8, :, 3] = 0  # rows of large v
    bare = scene_of([*ROOM, (sheet, MATT)])
    uvs = bare.uvs.copy()
    uvs[-4:] = [(0, 0), (0, 1), (1, 1), (1, 0)]
    pierced = Scene(
        origin=bare.origin, positions=bare.positions, normals=bare.normals, uvs=uvs, colors=bare.colors,
        triangles=bare.triangles, material_ids=bare.material_ids, textures=(texels,),
        materials=(MATT, MATT, area_light(), Material(texture=0, alpha_cutoff=0.5)),
    )  # fmt: skip
    # v runs along z: what is left is the half towards the wall.
    solid = scene_of([*ROOM, (((-1.5, 1.2, -1.5), (0, 0, 1.5), (3, 0, 0)), MATT)])
    found, right = lit(runtime, pierced, rays=4), lit(runtime, solid, rays=4)
    whole = lit(runtime, bare, rays=4)
    error = np.abs(found - right)[..., 0]
    # The edge of a hole runs between texels, bilinear in alpha; pixels at the sheet's edge differ.
    assert np.mean(error > 0.03 * right.max()) < 0.02
    assert np.mean(np.abs(whole - right)[..., 0] > 0.03 * right.max()) > 0.1


def test_a_margin_changes_nothing(runtime: Runtime) -> None:
    scene = scene_of([*ROOM, (TABLE, MATT)])
    # Rows and columns of the image are drawn with other offsets: one rounding of a pixel's position.
    inner, outer = lit(runtime, scene), lit(runtime, scene, overscan=0.15)
    assert np.percentile(np.abs(inner - outer), 99) < 1e-3 * inner.max()


def test_light_given_is_added(runtime: Runtime, rng: np.random.Generator) -> None:
    scene = scene_of([*ROOM, (TABLE, MATT)])
    seen = drawn(scene, camera_of(), runtime=runtime)
    given = rng.random((3, *seen.size)).astype(np.float32)
    with runtime.frame():
        plane = runtime.plane(3, seen.size)
        plane.upload(given)
        both = gi.AreaLights(runtime, seen.size).run(uploaded(runtime, seen), scene=scene, direct=plane)
        assert both is not None
        found = np.moveaxis(both.download(), 0, -1)
    there = np.isfinite(seen.depth)
    alone = gi.area_lights(seen, scene=scene, runtime=runtime)
    np.testing.assert_allclose(found[there], (alone + np.moveaxis(given, 0, -1))[there], rtol=1e-6)


def test_rays_of_the_reference_meet_what_is_in_their_way() -> None:
    wall = np.array([[(1, -1, -1), (1, 1, -1), (1, 0, 1)]], np.float64)
    way = np.array([(2, 0, 0), (0.9, 0, 0), (-2, 0, 0), (2, 3, 0)], np.float64)
    np.testing.assert_array_equal(blocked(wall, np.zeros(1, bool), np.zeros((4, 3)), way), [True, False, False, False])


@pytest.mark.parametrize(
    ("values", "message"),
    [({"rays": 0}, "rays is 0"), ({"blur": 17}, "blur is 17"), ({"more_rays": -1}, "more_rays is -1")],
)
def test_parameters_out_of_range_are_refused(runtime: Runtime, values: dict[str, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        lit(runtime, scene_of(ROOM), **values)
    with pytest.raises(TypeError, match="scene is NoneType"):
        gi.area_lights(drawn(scene_of(ROOM), camera_of(), runtime=runtime), scene=None, runtime=runtime)  # type: ignore[arg-type]
