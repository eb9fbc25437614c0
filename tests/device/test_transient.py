"""Memory that passes share: one user at a time, free as soon as nothing refers to it."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.errors import DeviceMemoryError
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import plane_bytes
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.transient import TransientMemory, TransientPlane
from ssgi_cl.device.transient_chunks import ALIGNMENT
from ssgi_cl.frame.render import render
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.rasterize.scenes import make_scene

MEBI = 1 << 20
SIZE = (48, 40)
BYTES = -(-plane_bytes(1, SIZE) // ALIGNMENT) * ALIGNMENT


@pytest.fixture
def memory(variant_runtime: Runtime) -> TransientMemory:
    return TransientMemory(variant_runtime)


def test_two_live_planes_never_share_memory(memory: TransientMemory) -> None:
    first, second = memory.plane(1, SIZE), memory.plane(1, SIZE)
    first.upload(np.full((1, *SIZE), 1.0, np.float32))
    second.upload(np.full((1, *SIZE), 2.0, np.float32))
    assert (first.download() == 1.0).all()
    assert (second.download() == 2.0).all()
    assert memory.used == memory.size == 2 * BYTES


def test_memory_is_free_as_soon_as_nothing_refers_to_a_plane(memory: TransientMemory) -> None:
    plane = memory.plane(2, SIZE)
    taken = memory.runtime.allocated_bytes
    del plane
    assert memory.used == 0
    # A large piece serves several small ones.
    planes = [memory.plane(1, SIZE), memory.array(10, np.int32)]
    assert memory.used < memory.size
    assert len(planes) == 2
    # The values of the guards are this module's own.
    assert memory.runtime.allocated_bytes == taken


def test_what_an_exception_leaves_is_free(memory: TransientMemory) -> None:
    def failing() -> None:
        plane = memory.plane(1, SIZE)
        assert memory.used == BYTES
        raise KeyboardInterrupt(plane.count)

    with pytest.raises(KeyboardInterrupt):
        failing()
    gc.collect()
    assert memory.used == 0


def test_a_plane_has_its_outside_value_round_it_whatever_was_there(memory: TransientMemory) -> None:
    memory._spoiling = True
    for outside in (0.0, np.inf, 0.0):
        plane = memory.plane(2, SIZE, outside)
        plane.upload(np.full((2, *SIZE), 5.0, np.float32))
        with plane._mapped() as rows:
            assert (rows[0] == outside).all()
            assert (rows[-1] == outside).all()
            assert (rows[:, SIZE[1] :] == outside).all()
            assert (rows[1:-1, : SIZE[1]] == 5.0).all()
        del rows, plane


def test_outside_of_a_window_a_plane_has_its_background(memory: TransientMemory) -> None:
    memory._spoiling = True
    plane = memory.plane(2, SIZE, 1.0, background=(1.0, 0.25))
    assert isinstance(plane, TransientPlane)
    assert plane.within(None) is None
    assert np.isnan(plane.download()).all()
    region = Region(0, 0, 8, 8)
    assert plane.within(region) is region
    np.testing.assert_array_equal(plane.download(), np.full((2, *SIZE), [[[1.0]], [[0.25]]]))
    with plane._mapped() as rows:
        assert (rows[:, SIZE[1] :] == 1.0).all()


def test_without_sharing_no_memory_is_given_out_twice(memory: TransientMemory) -> None:
    memory._sharing = False
    first = memory.plane(1, SIZE)
    del first
    before = memory.runtime.allocated_bytes
    plane = memory.plane(1, SIZE)
    assert plane.count == 1
    assert memory.runtime.allocated_bytes >= before + BYTES


def test_what_is_reserved_is_enough_and_is_counted(memory: TransientMemory) -> None:
    runtime, wanted = memory.runtime, 3 * BYTES
    kept = memory.plane(1, SIZE)
    needed = runtime.memory.needed(lambda: memory.reserve(wanted))
    assert needed == 2 * BYTES
    memory.reserve(wanted)
    assert memory.size == wanted
    assert runtime.memory.needed(lambda: memory.reserve(wanted)) == 0
    more = [memory.plane(1, SIZE) for _ in range(2)]
    assert (memory.size, memory.used) == (wanted, wanted)
    assert len(more) == 2
    assert kept.count == 1


def test_memory_that_is_free_gives_way(memory: TransientMemory, monkeypatch: pytest.MonkeyPatch) -> None:
    runtime = memory.runtime
    monkeypatch.setattr(runtime, "transient", memory)
    runtime.forget()  # what tests before this one left would give way too, and may be as much as is asked for
    plane = memory.plane(1, SIZE)
    monkeypatch.setattr(runtime.memory, "limit", runtime.memory.used + MEBI // 2)
    runtime._prepared.calls += 1
    with pytest.raises(DeviceMemoryError, match="no room"):
        memory.reserve(1000 * MEBI)
    assert memory.size == BYTES
    del plane
    runtime._prepared.calls += 1
    assert memory.let_go(runtime.calls)
    assert memory.size == 0


MODES: dict[str, dict[str, Any]] = {
    "ao at half size": {"ao": "hbao", "layers": 2, "overscan": 0.1, "gbuffer": True},
    "ssdo": {"indirect": "ssdo", "layers": 2, "auxiliary_cameras": 2},
    "ssdo published": {"indirect": "ssdo", "method": "published"},
    "ao": {},
    "multires": {"indirect": "multires"},
}


@pytest.fixture
def spoilt(plain_images: Runtime) -> Iterator[Runtime]:
    yield plain_images
    plain_images.transient._spoiling, plain_images.transient._sharing = False, True
    plain_images._prepared.clear()


# `stress/test_same_bits.py` spoils the memory of single techniques too.
@pytest.mark.parametrize("scene", ["cornell_box", pytest.param("machine-3", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "mode", [pytest.param(mode, marks=[pytest.mark.slow] * (mode in ("ao", "multires"))) for mode in MODES]
)
def test_no_bit_depends_on_what_memory_held_before(spoilt: Runtime, scene: str, mode: str) -> None:
    built = make_scene(scene)
    lights = (*built.lights, gi.Environment((0.2, 0.3, 0.4)))
    eye, target = np.array(built.eye), np.array(built.target)
    # Far away the scene is in a window of the image.
    cameras = [
        gi.Camera.look_at(target + k * (eye - target), target, built.up, yfov=built.yfov, width=96, height=32)
        for k in (1.0, 1.5, 1.2)
    ]
    found = []
    for sharing in (False, True):
        spoilt._prepared.clear()
        spoilt.transient._sharing = sharing
        spoilt.transient._spoiling = sharing
        given = {"bounces": 0, "shadow_size": 64, "exposure": 1.0, "runtime": spoilt, **MODES[mode]}
        found.append([render(built.scene, camera, lights, **given) for camera in cameras])
    for alone, shared in zip(*found, strict=True):
        np.testing.assert_array_equal(alone.radiance, shared.radiance)
        for name in ("ao", "indirect"):
            one, other = getattr(alone, name), getattr(shared, name)
            assert (one is None) == (other is None)
            if one is not None:
                np.testing.assert_array_equal(one, other)
        if alone.gbuffer is not None:
            np.testing.assert_array_equal(alone.gbuffer.normal, shared.gbuffer.normal)


LIMITS: dict[str, tuple[dict[str, Any], float]] = {
    "all light": ({}, 900.0),
    "direct light and AO": ({"bounces": 0}, 200.0),
    "ssdo": ({"bounces": 0, "indirect": "ssdo", "layers": 2, "auxiliary_cameras": 4}, 450.0),
}
"""Arguments of a frame, and how much of the device's memory it may keep, MiB."""


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["cornell_box", "hall"])
@pytest.mark.parametrize("mode", LIMITS)
def test_a_frame_of_1920_x_1080_keeps_no_more_than(runtime: Runtime, scene: str, mode: str) -> None:
    if runtime.variant.storage != "buffer":
        pytest.skip("images are copies")
    built, (arguments, limit) = make_scene(scene), LIMITS[mode]
    spot = next(light for light in built.lights if isinstance(light, gi.SpotLight))
    lights = (spot, gi.Environment((0.3, 0.3, 0.3)))
    runtime._prepared.clear()
    runtime.transient.__init__(runtime)  # type: ignore[misc]  # nothing is there yet
    gc.collect()
    device_scene(built.scene, runtime)
    before = runtime.memory.used
    for _ in range(2):
        render(built.scene, built.camera(1920, 1080), lights, runtime=runtime, **arguments)
    kept = (runtime.memory.used - before) / MEBI
    runtime._prepared.clear()
    assert 0.0 < kept <= limit


def test_a_second_frame_takes_no_memory_though_everything_is_drawn_anew(plain_images: Runtime) -> None:
    built = make_scene("cornell_box")
    lights = (*built.lights, gi.Environment((0.2, 0.3, 0.4)))
    options = {"indirect": "ssdo", "layers": 2, "auxiliary_cameras": 2, "shadow_size": 64, "skips": False}

    def frame() -> None:
        render(built.scene, built.camera(64, 48), lights, runtime=plain_images, **options)

    frame()
    frame()  # the first had other memory to choose from
    before = plain_images.allocated_bytes, plain_images.builds
    frame()
    assert (plain_images.allocated_bytes, plain_images.builds) == before
    held = plain_images.transient.used
    frame()
    assert plain_images.transient.used == held
