"""Tiles in which directional occlusion is proven to find nothing, and what they leave out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from ssgi_cl.bench.skip_scenes import SKIP_SCENES
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment, Light, PointLight
from ssgi_cl.device.arrays import Plane as Images
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.plan import SKIPS
from ssgi_cl.frame.render import Frame, render
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer
from ssgi_cl.techniques.indirect.ssdo import Ssdo
from ssgi_cl.techniques.indirect.ssdo_bitmask import SsdoBitmask, SsdoBitmaskParams
from ssgi_cl.techniques.indirect.ssdo_params import SsdoParams
from ssgi_cl.techniques.tiles import OpenTiles, Tiles

from .analytic import CAMERAS, Plane, camera, trace

SIZE = (120, 168)
MARGIN = (12, 18)
QUICK: dict[str, Any] = {"slices": 1, "taps": 4}
"""With this size and margin the kernels of test_ssdo.py."""

LAMP = PointLight((0.3, 1.5, 1.2), (1, 2, 3))
SKY = Environment(0.5)
IMAGE = Environment(np.random.default_rng(3).random((8, 16, 3)))
SLOW = pytest.mark.slow
RADIUS = 0.1


def uploaded(runtime: Runtime, gbuffer: GBuffer) -> DeviceGBuffer:
    layers = gbuffer.layers
    device = DeviceGBuffer(runtime, gbuffer.size, layers=layers, margin=gbuffer.margin, attributes=layers)
    device.upload(gbuffer)
    return device


def floor_and_wall(seen_by: Camera, margin: tuple[int, int] = (0, 0)) -> GBuffer:
    """Return a floor under the sky, a wall on its left, and the floor behind that."""
    floor = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), ((0.0, 0.0, 1.0), -6.0))
    wall = Plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), ((-1.0, 0.0, 0.0), 0.9))
    front, back = (trace(seen_by, things, margin=margin) for things in ([floor, wall], [floor]))
    depth, normal = (
        np.stack([np.asarray(getattr(each, name)) for each in (front, back)]) for name in ("depth", "normal")
    )
    nothing = ~(depth[1] > depth[0])
    depth[1][nothing] = np.inf
    normal[1][nothing] = 0.0
    albedo = np.random.default_rng(1).random((*depth.shape, 3), np.float32)
    return GBuffer(camera=seen_by, depth=depth, normal=normal, albedo=albedo)


def proven(technique: Ssdo | SsdoBitmask, device: DeviceGBuffer) -> OpenTiles:
    tiles = Tiles(device.runtime, device.size, device.margin, device.layers, pieces=True)
    tiles.look(device)
    reach = technique.reach(device)
    assert reach is not None
    return tiles.open(device, reach)


# ---- no bit changes


@pytest.mark.parametrize(
    ("name", "lights", "options"),
    [
        ("perspective", [LAMP], {}),
        pytest.param("orthographic", [SKY], {"resolution": "half", "radius": 0.2}, marks=SLOW),
        pytest.param("off-centre", [LAMP, IMAGE], {"slices": 2, "taps": 20}, marks=SLOW),
        pytest.param("perspective", [SKY], {"resolution": "quarter", "radius": 0.2}, marks=SLOW),
        pytest.param("perspective", [IMAGE], {"bounce": False, "blur_passes": 2}, marks=SLOW),
        pytest.param(
            "intrinsics",
            [LAMP, SKY],
            {"resolution": "half", "blur_resolution": "full", "max_radius_px": 5.0},
            marks=SLOW,
        ),
    ],
    ids=str,
)
@pytest.mark.parametrize("views", [pytest.param(0, id="alone"), pytest.param(1, marks=SLOW)])
def test_open_tiles_change_no_bit_of_light(
    runtime: Runtime, name: str, lights: list[Light], options: dict[str, Any], views: int
) -> None:
    device = uploaded(runtime, floor_and_wall(camera(name, SIZE), MARGIN))
    params = SsdoParams(**{"radius": RADIUS, **QUICK, **options})
    other = camera("perspective", (60, 84), eye=(-2.0, 1.0, 3.0))
    further = [uploaded(runtime, floor_and_wall(other))][:views]
    technique = Ssdo(runtime, SIZE, params, MARGIN, 2, 2)
    tiles = proven(technique, device)
    assert tiles.empty < tiles.open < tiles.total
    found = []
    for known in (None, tiles):
        with runtime.frame():
            planes = technique.run(device, lights, auxiliary_views=further, tiles=known)
            found.append(
                [
                    None if plane is None else plane.download()
                    for plane in (planes.direct, planes.bounce, planes.visibility)
                ]
            )
    for expected, got in zip(*found, strict=True):
        np.testing.assert_equal(got, expected)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60))
def test_proven_tiles_of_random_planes_hide_and_send_nothing(runtime: Runtime, seed: int) -> None:
    rng = np.random.default_rng(seed)
    name = CAMERAS[seed % len(CAMERAS)]
    size, margin = (150 - seed, 97 + seed), (seed % 3, seed % 7)
    high, turn, far = rng.uniform(0.06, 1.5), rng.uniform(0.0, 6.3), 10.0 ** rng.uniform(-1, 3)
    eye = far * np.array([np.cos(high) * np.cos(turn), np.sin(high), np.cos(high) * np.sin(turn)])
    seen_by = camera(name, size, eye=eye, target=(0.0, 0.0, 0.0))
    towards = np.array([np.cos(3.0 * turn), 0.0, np.sin(3.0 * turn)])
    kept = (towards, 0.1 * far * rng.standard_normal())
    step = far * 10.0 ** rng.uniform(-8.0, -1.0)
    bend = 10.0 ** rng.uniform(-7.0, -0.3)
    up = np.array([0.0, 1.0, 0.0])
    things = [
        Plane((0.0, 0.0, 0.0), up),
        Plane((0.0, step, 0.0), up, kept),
        Plane(towards * kept[1], up + np.tan(bend) * towards, kept),
    ]
    front = trace(seen_by, [things[0], things[seed % 3]], margin=margin)
    below = Plane((0.0, -1e3 * step, 0.0), up + 0.3 * rng.standard_normal(3), kept)
    back = np.asarray(trace(seen_by, [below], margin=margin).depth)
    depth = np.asarray(front.depth)
    depth = np.stack([depth, np.where(back > depth, back, np.inf)])[: 1 + seed % 2]
    made = GBuffer(camera=seen_by, depth=depth, normal=np.asarray(front.normal))
    device = DeviceGBuffer(runtime, made.size, layers=len(depth), margin=made.margin)
    device.upload(made)
    resolution = ("full", "half", "quarter")[seed % 3]
    params = SsdoBitmaskParams(radius=far * 10.0 ** rng.uniform(-2.5, -0.4), taps=20, resolution=resolution)
    technique = SsdoBitmask(runtime, made.size, params, made.margin, len(depth), masks=True)
    radiance: Images = runtime.plane(3 * len(depth), device.whole)
    radiance.upload(0.1 + rng.random((3 * len(depth), *device.whole), np.float32))
    every = 2 ** (seed % 3)
    with runtime.frame():
        source: Any = device if every == 1 else ReducedGBuffer(device, every)
        if every > 1:
            source.update(device)
        light = technique.run(device, source, radiance=radiance).download()
        tiles = proven(technique, device)
        again = technique.run(device, source, radiance=radiance, tiles=tiles).download()
    np.testing.assert_array_equal(again, light)
    bits = tiles.bits.download().reshape(-1, tiles.columns) & 1
    inside = np.kron(bits, np.ones((16, 16), int))[: size[0] : every, : size[1] : every] > 0
    assert (light[0][inside] == 1.0).all()
    assert (light[1:, inside] == 0.0).all()


# ---- what is not proven


def test_deeper_layers_and_ends_of_planes_within_reach_are_not_flat(runtime: Runtime) -> None:
    seen_by = camera("perspective", SIZE)
    gbuffer = floor_and_wall(seen_by)
    depth, normal = np.asarray(gbuffer.depth), np.asarray(gbuffer.normal)
    only = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    floor = np.asarray(trace(seen_by, [only]).depth)
    params = SsdoBitmaskParams(radius=RADIUS)
    found = {}
    for name, deeper in (("none", np.inf), ("some", 2.0)):
        second = np.full_like(floor, np.inf)
        second[100, 20] = deeper * floor[100, 20]
        layered = GBuffer(camera=seen_by, depth=np.stack([floor, second]), normal=trace(seen_by, [only]).normal)
        device = uploaded(
            runtime, GBuffer(camera=seen_by, depth=layered.depth, normal=np.stack([np.asarray(layered.normal)] * 2))
        )
        tiles = proven(SsdoBitmask(runtime, SIZE, params, (0, 0), 2), device)
        found[name] = tiles.bits.download().reshape(-1, tiles.columns) & 1
    place = 100 // 16, 20 // 16
    assert found["none"][place]
    assert not found["some"][place]
    assert 0 < found["some"].sum() < found["none"].sum()
    # Beside a wall ambient occlusion may be proven where its plane, going on, is not.
    device = uploaded(runtime, GBuffer(camera=seen_by, depth=depth, normal=normal))
    technique = SsdoBitmask(runtime, SIZE, params, (0, 0), 2)
    points = Tiles(runtime, SIZE, (0, 0), 2)
    points.look(device)
    reach = technique.reach(device)
    assert reach is not None
    pieces, taps = (each.bits.download() & 1 for each in (proven(technique, device), points.open(device, reach)))
    assert (pieces <= taps).all()
    assert pieces.sum() < taps.sum()


def test_thick_planes_and_points_have_no_reach(runtime: Runtime) -> None:
    gbuffer = floor_and_wall(camera("perspective", SIZE))
    device = uploaded(runtime, gbuffer)
    for choice in ({"thickness": 0.1}, {"method": "points"}):
        params = SsdoParams(**QUICK, **choice)  # type: ignore[arg-type]
        assert Ssdo(runtime, SIZE, params, (0, 0), 2, 2).reach(device) is None


# ---- frames


def drawn(runtime: Runtime, name: str, skips: Any, size: tuple[int, int] = (160, 120), **options: Any) -> Frame:
    built = next(make() for make in SKIP_SCENES if make.__name__ == name)
    given = {"indirect": "ssdo", "layers": 2, "shadow_size": 64, "ao_radius": 0.2, **options}
    lights = (*built.lights, *given.pop("lights", ()))
    return render(built.scene, built.camera(*size), lights, bounces=0, skips=skips, runtime=runtime, **given)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("flat_floor", {}),
        ("flat_floor", {"overscan": 0.2}),
        ("flat_floor", {"lights": (IMAGE,)}),
        ("flat_floor", {"auxiliary_cameras": 1}),
        ("many_lamps", {"overscan": 0.1}),
        ("lone_object", {}),
    ],
    ids=str,
)
def test_skips_leave_the_bits_of_frames(runtime: Runtime, name: str, options: dict[str, Any]) -> None:
    moving = frozenset(SKIPS) - {"unchanged"}
    expected = drawn(runtime, name, False, **options)
    for skips in (["tiles"], moving, moving):
        frame = drawn(runtime, name, skips, **options)
        np.testing.assert_array_equal(frame.radiance, expected.radiance)
        np.testing.assert_equal(frame.indirect, expected.indirect)


@pytest.mark.slow
def test_a_flat_floor_needs_lights_alone_and_says_so(runtime: Runtime) -> None:
    frame = drawn(runtime, "flat_floor", ["tiles"], (480, 360))
    told = {p.name: p.skipped for p in frame.passes if p.skipped}
    assert told["ssdo tiles"] == "690 of 690 tiles are open (690 flat)"
    ran = [p.name for p in frame.passes if not p.skipped]
    assert not {"ssdo_bitmask", "senders", "lit layer 1", "upsample", "blur rows"} & set(ran)
    assert {"light directional", "ssdo split", "combine"} <= set(ran)
