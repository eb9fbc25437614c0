"""Smooth edges: against the numpy reference, and closed forms of what pixels show."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.pixel_places import pixel_places
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.raster.rasterizer import SUBPIXELS, TILE, Rasterizer
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.reference.filters.smooth_edges import smooth_edges_reference
from ssgi_cl.reference.gbuffer import SurfaceView
from ssgi_cl.techniques.filters.smooth_edges import SmoothEdges

from ...rasterize.meshes import scene_of

Floats = NDArray[np.float32]

CAMERAS: dict[str, dict[str, Any]] = {
    "perspective": {},
    "reversed": {"reversed_z": True},
    "orthographic": {"view_height": 6.0},
    "intrinsics": {"fx": 70.0, "fy": 90.0, "cx": 40.5, "cy": 20.25},
}


def camera_of(kind: str, eye: Any, target: Any, size: tuple[int, int] = (45, 70)) -> Camera:
    given, extent = CAMERAS[kind], {"width": size[1], "height": size[0]}
    if kind == "orthographic":
        return Camera.orthographic(eye, target, **given, **extent)
    if kind == "intrinsics":
        view = Camera.look_at(eye, target, **extent).view
        return Camera.from_intrinsics(view=view, **given, **extent)
    return Camera.look_at(eye, target, yfov=0.9, **given, **extent)


class Drawn:
    """A scene drawn at pixel centres and at places, and what smooths pictures of it."""

    def __init__(self, scene: Scene, camera: Camera, runtime: Runtime, places: int = 7) -> None:
        self.runtime, self.camera, self.scene = runtime, camera, DeviceScene(runtime, scene)
        self.technique = SmoothEdges(runtime, camera.size, places)
        self.source, self.count = scene, places
        rasterizer = Rasterizer(runtime, camera.size, world="kept", lobes=True)
        with runtime.frame():
            self.gbuffer = rasterizer.render(self.scene, camera)
            self.gbuffer.derive()
            sampled = Rasterizer(runtime, camera.size, shaded=False, places=self.technique.places)
            visible = sampled.sampled(self.scene, camera)
            self.triangles, self.d = (
                self._images(array.download(), sampled) for array in (visible.triangles, visible.depths)
            )

    def _images(self, flat: NDArray[Any], rasterizer: Rasterizer) -> NDArray[Any]:
        """Return [places, rows, columns] of what is tiled."""
        rows, columns = self.camera.size
        tiles = -(-rows // TILE), -(-columns // TILE)
        whole = flat.reshape(*tiles, TILE, TILE, rasterizer.stride).transpose(4, 0, 2, 1, 3)
        whole = whole.reshape(rasterizer.stride, tiles[0] * TILE, tiles[1] * TILE)
        return whole[: len(self.technique.places), :rows, :columns]

    def smoothed(self, radiance: NDArray[Any]) -> Floats:
        plane = self.runtime.plane(3, self.camera.size)
        plane.upload(np.moveaxis(radiance.astype(np.float32), -1, 0))
        with self.runtime.frame():
            result = self.technique.run(self.gbuffer, plane, scene=self.scene, camera=self.camera)
            return np.moveaxis(result.download(), 0, -1).copy()

    def reference(self, radiance: NDArray[Any]) -> NDArray[np.float64]:
        there = self.triangles >= 0
        d = np.where(there, self.d, 1.0).astype(np.float64)
        depths = -d if self.camera.is_orthographic else 1.0 / d
        places = np.array(self.technique.places) / SUBPIXELS
        first = 0 if self.count % 2 else 1  # an even number of places has none in the centre
        view = SurfaceView(
            camera=self.camera,
            depth=self.gbuffer.depth.download()[0].astype(np.float64),
            normal=np.moveaxis(self.gbuffer.normal.download(), 0, -1).astype(np.float64),
            size=self.camera.size,
            margin=(0, 0),
            origin=(0, 0),
        )
        materials = np.asarray(self.source.material_ids)
        return smooth_edges_reference(
            radiance, view, self.triangles[0], self.triangles[first:], depths[first:], places[first:], materials
        )


def flat_on(points: Any, width: int, height: int) -> Camera:
    """Return a camera that sees points (x, y, 0) in pixels, y downwards from the top."""
    del points
    return Camera.orthographic(
        (width / 2, -height / 2, 10.0), (width / 2, -height / 2, 0.0), view_height=height, width=width, height=height
    )


def picture(quads: list[list[tuple[float, float]]], size: tuple[int, int], runtime: Runtime, places: int) -> Drawn:
    """Draw quadrilaterals given by columns and rows, nearer ones later."""
    points = [(x, -y, 0.01 * i) for i, quad in enumerate(quads) for x, y in quad]
    triangles = [(4 * i + a, 4 * i + b, 4 * i + c) for i in range(len(quads)) for a, b, c in ((0, 1, 2), (0, 2, 3))]
    return Drawn(scene_of(points, triangles), flat_on(points, size[1], size[0]), runtime, places)


def covered(drawn: Drawn) -> Floats:
    """Return what is smoothed of 1 where anything is seen and 0 elsewhere."""
    seen = np.repeat((drawn.triangles[0] >= 0).astype(np.float32)[..., None], 3, axis=-1)
    return drawn.smoothed(seen)[..., 0]


# ---- against the reference


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("name", ["cornell_box", "workshop"])
def test_kernel_agrees_with_reference_in_every_camera(
    runtime: Runtime, rng: np.random.Generator, name: str, kind: str
) -> None:
    built = make_scene(name)
    drawn = Drawn(built.scene, camera_of(kind, built.eye, built.target), runtime)
    radiance = rng.random((*drawn.camera.size, 3)).astype(np.float32)
    off = np.abs(drawn.smoothed(radiance) - drawn.reference(radiance)).max(axis=-1)
    # Where scores are equal but for float32, another pixel is taken: measured .1 % of the pixels.
    assert (off > 1e-5).mean() < 5e-3
    assert np.abs(drawn.smoothed(radiance) - radiance).max() > 0.2


@pytest.mark.parametrize("places", [1, 2, 5, 7, 8, 13, 64])
def test_every_kernel_variant_agrees_with_reference(
    variant_runtime: Runtime, rng: np.random.Generator, places: int
) -> None:
    built = make_scene("cornell_box")
    drawn = Drawn(built.scene, camera_of("perspective", built.eye, built.target, (37, 41)), variant_runtime, places)
    radiance = rng.random((*drawn.camera.size, 3)).astype(np.float32)
    off = np.abs(drawn.smoothed(radiance) - drawn.reference(radiance)).max(axis=-1)
    assert (off > 1e-5).mean() < 5e-3


def test_centres_are_what_the_rasteriser_sees(runtime: Runtime) -> None:
    built = make_scene("workshop")
    camera = camera_of("perspective", built.eye, built.target, (90, 140))
    drawn = Drawn(built.scene, camera, runtime)
    rasterizer = Rasterizer(runtime, camera.size, shaded=False)
    with runtime.frame():
        rasterizer.render(drawn.scene, camera)
        assert rasterizer.depths is not None
        flat = rasterizer.depths.download()
    tiles = -(-camera.height // TILE), -(-camera.width // TILE)
    whole = flat.reshape(*tiles, TILE, TILE).transpose(0, 2, 1, 3).reshape(tiles[0] * TILE, tiles[1] * TILE)
    np.testing.assert_array_equal(drawn.d[0], whole[: camera.height, : camera.width])


def test_places_are_what_moved_cameras_see(runtime: Runtime) -> None:
    built = make_scene("workshop")
    camera = camera_of("orthographic", built.eye, built.target, (90, 140))
    drawn = Drawn(built.scene, camera, runtime)
    sx, sy, _, _ = camera.pixel_to_view
    for number, (right, down) in enumerate(drawn.technique.places):
        view = camera.view.copy()
        view[0, 3] -= sx * right / SUBPIXELS
        view[1, 3] -= sy * down / SUBPIXELS
        moved = Camera(view=view, projection=camera.projection, width=camera.width, height=camera.height)
        seen = Drawn(built.scene, moved, runtime).triangles[0]
        # Vertices snap to 1/256 pixel, to another one of two here and there: measured .1 %.
        assert (seen != drawn.triangles[number]).mean() < 5e-3, number


# ---- closed forms


def overlap(angle: float, through: tuple[float, float], size: tuple[int, int]) -> NDArray[np.float64]:
    """Return the share of each pixel on the left of a line, from 32 x 32 points of it."""
    steps = (np.arange(32) + 0.5) / 32
    y = (np.arange(size[0])[:, None] + steps).reshape(-1, 1) - through[1]
    x = (np.arange(size[1])[:, None] + steps).reshape(1, -1) - through[0]
    left = (x * math.cos(angle) + y * math.sin(angle) < 0.0).astype(np.float64)
    return left.reshape(size[0], 32, size[1], 32).mean(axis=(1, 3))


@pytest.mark.parametrize("angle", [0.0, 0.1, 0.5, math.pi / 4, 1.2, math.pi / 2])
@pytest.mark.parametrize("places", [5, 7, 8, 13])
def test_a_half_plane_covers_its_share_of_each_pixel(runtime: Runtime, angle: float, places: int) -> None:
    size, through = (24, 40), (20.3, 12.4)
    along = np.array((-math.sin(angle), math.cos(angle)))
    left = np.array((-math.cos(angle), -math.sin(angle)))
    corners = [through - 99 * along, through + 99 * along, through + 99 * (along + left), through + 99 * (left - along)]
    found = covered(picture([[tuple(c) for c in corners]], size, runtime, places))
    off = found - overlap(angle, through, size)
    # Two places may lie on a line of the edge's direction; so may one of each pixel along an upright edge.
    assert np.abs(off).max() <= 2.0 / places
    assert abs(float(off[off != 0.0].mean())) <= 1.0 / places


def test_a_line_thinner_than_a_pixel_keeps_its_mean(runtime: Runtime) -> None:
    size, slope, width = (60, 60), 0.37, 0.25
    quad = [(10.0, -5.0), (10.0 + width, -5.0), (10.0 + width + 70 * slope, 65.0), (10.0 + 70 * slope, 65.0)]
    drawn = picture([quad], size, runtime, 13)
    plain = (drawn.triangles[0] >= 0)[2:-2].sum(axis=1)
    assert set(plain.tolist()) == {0, 1}  # centres see dashes
    rows = covered(drawn)[2:-2].sum(axis=1)
    assert rows.mean() == pytest.approx(width, rel=0.1)
    # Rows whose centres within two pixels all miss it show nothing.
    assert (rows > 0.1).mean() > 0.9


def test_one_surface_keeps_every_bit(runtime: Runtime, rng: np.random.Generator) -> None:
    radiance = np.exp(rng.normal(0.0, 4.0, (24, 40, 3))).astype(np.float32)
    drawn = picture([[(-9.0, -9.0), (90.0, -9.0), (90.0, 90.0), (-9.0, 90.0)]], (24, 40), runtime, 7)
    np.testing.assert_array_equal(drawn.smoothed(radiance), radiance)


@pytest.mark.parametrize("places", [1, 3, 7, 8])
def test_equal_colours_keep_every_bit(variant_runtime: Runtime, places: int) -> None:
    built = make_scene("cornell_box")
    drawn = Drawn(built.scene, camera_of("perspective", built.eye, built.target), variant_runtime, places)
    radiance = np.full((*drawn.camera.size, 3), (0.1, 1.0 / 3.0, 7e5), np.float32)
    np.testing.assert_array_equal(drawn.smoothed(radiance), radiance)


def test_colours_stay_within_those_of_the_pixels_around(runtime: Runtime, rng: np.random.Generator) -> None:
    built = make_scene("workshop")
    drawn = Drawn(built.scene, camera_of("perspective", built.eye, built.target), runtime)
    radiance = np.exp(rng.normal(0.0, 6.0, (*drawn.camera.size, 3))).astype(np.float32)
    around = np.pad(radiance, ((2, 2), (2, 2), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(around, (5, 5), axis=(0, 1))
    least, most = windows.min(axis=(-2, -1)), windows.max(axis=(-2, -1))
    found = drawn.smoothed(radiance)
    # Roundings of sums of seven are relative to the greatest of them.
    assert np.all(found >= least - 1e-6 * most)
    assert np.all(found <= most * (1.0 + 1e-6))
    assert not np.array_equal(found, radiance)


def test_materials_of_one_plane_have_an_edge(runtime: Runtime) -> None:
    points = [(x, -y, 0.0) for x in (-9.0, 10.25, 90.0) for y in (-9.0, 90.0)]
    triangles = [(0, 1, 3), (0, 3, 2), (2, 3, 5), (2, 5, 4)]
    for ids, expected in (((0, 0, 1, 1), 2.0 / 8.0), ((0, 0, 0, 0), 0.0)):
        scene = scene_of(points, triangles, material_ids=np.array(ids), materials=(Material(), Material()))
        drawn = Drawn(scene, flat_on(points, 24, 16), runtime, 8)
        radiance = np.zeros((16, 24, 3))
        radiance[:, :10] = 1.0
        found = drawn.smoothed(radiance)[4, 8:12, 0]
        # A quarter of column 10 is on the left; one surface of one material has its own radiance.
        np.testing.assert_allclose(found, [1.0, 1.0, expected, 0.0], atol=1e-6)


def test_holes_have_smooth_edges(runtime: Runtime) -> None:
    alpha = np.full((2, 2, 4), 255, np.uint8)
    alpha[:, 1, 3] = 0
    corners = [(0.0, 0.0, 0.0), (24.5, 0.0, 0.0), (24.5, -16.0, 0.0), (0.0, -16.0, 0.0)]
    scene = scene_of(
        corners, [(0, 1, 2), (0, 2, 3)], uvs=[(0, 0), (1, 0), (1, 1), (0, 1)],
        textures=(alpha,), materials=(Material(texture=0, alpha_cutoff=0.5),),
    )  # fmt: skip
    found = covered(Drawn(scene, flat_on(corners, 30, 16), runtime, 8))
    # Alpha is one half a quarter of a pixel beyond column 12, and again at the other end, where it repeats.
    assert found[8, 10:15] == pytest.approx([1.0, 1.0, 0.25, 0.0, 0.0], abs=1.0 / 8.0)


# ---- bounds


def test_an_image_of_a_pixel_and_an_empty_one(runtime: Runtime) -> None:
    quad = [(0.5, -1.0), (2.0, -1.0), (2.0, 2.0), (0.5, 2.0)]
    drawn = picture([quad], (1, 1), runtime, 8)
    np.testing.assert_array_equal(drawn.smoothed(np.full((1, 1, 3), 2.5)), np.full((1, 1, 3), np.float32(2.5)))
    away = picture([[(50.0, 0.0), (60.0, 0.0), (60.0, 9.0), (50.0, 9.0)]], (5, 7), runtime, 7)
    radiance = np.arange(105, dtype=np.float32).reshape(5, 7, 3)
    np.testing.assert_array_equal(away.smoothed(radiance), radiance)


@pytest.mark.parametrize("count", [1, 2, 3, 5, 7, 8, 13, 64])
def test_places_are_spread_evenly(count: int) -> None:
    places = pixel_places(count)
    assert places.shape == (count, 2)
    for axis in (0, 1):  # one in each row and column
        assert sorted((places[:, axis] * count - 0.5).round().astype(int)) == list(range(count))
    assert ((places == 0.5).all(axis=1).sum() == 1) == bool(count % 2)
    np.testing.assert_allclose(places.mean(axis=0), 0.5, atol=1e-12)
