"""A device with too little memory, and memory that must not grow."""

from __future__ import annotations

import gc
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.errors import DeviceMemoryError
from ssgi_cl.device.opencl import opencl
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.transient_chunks import ALIGNMENT
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.render import Renderer, render
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.techniques.ao.gtao import GtaoParams

MEBI = 1 << 20
BOX = BUILTIN_SCENES["cornell_box"]()


@pytest.fixture
def tight(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> Iterator[Runtime]:
    """The device with nothing kept and a limit of 64 MiB beyond what is in use."""
    runtime._prepared.clear()
    gc.collect()
    monkeypatch.setattr(runtime.memory, "limit", runtime.memory.used + 64 * MEBI)
    yield runtime
    runtime._prepared.clear()


def test_a_frame_that_does_not_fit_is_refused_before_any_pass_with_what_it_needs(tight: Runtime) -> None:
    before = tight.memory.used
    with tight.frame(), pytest.raises(DeviceMemoryError, match=r"no room(.|\n)*MiB are needed in all") as refused:
        render(BOX.scene, BOX.camera(8192, 8192), BOX.lights, bounces=0, ao_radius=0.5, runtime=tight)
    assert not tight.times()
    needed = float(re.findall(r"([\d.]+) MiB are needed", str(refused.value))[0])
    # 15 floats a pixel at the least: depth and its inverse, normal, albedo, A, radiance; and direct light, which
    # has the memory of the visibility buffer.
    assert needed > 15 * 4 * 8192**2 / MEBI
    del refused
    gc.collect()
    # The scene itself stays; nothing of the frame does.
    assert tight.memory.used - before < 4 * MEBI


def test_after_a_refusal_a_smaller_frame_is_rendered(tight: Runtime) -> None:
    with pytest.raises(DeviceMemoryError):
        render(BOX.scene, BOX.camera(4096, 4096), BOX.lights, bounces=0, runtime=tight, shadow_size=64)
    frame = render(BOX.scene, BOX.camera(64, 48), BOX.lights, bounces=0, runtime=tight, shadow_size=64)
    assert np.isfinite(frame.radiance).all()


def test_what_is_kept_gives_way_to_what_is_asked_for(tight: Runtime) -> None:
    tight.prepared("a", lambda: tight.plane(1, (2048, 4096)))  # half of the room
    assert tight.prepared("b", lambda: tight.plane(1, (3000, 4096))).count == 1
    assert tight.prepared("a", lambda: None) is None


def test_what_is_counted_is_what_is_taken(runtime: Runtime) -> None:
    def make() -> Renderer:
        return Renderer(runtime, (48, 64), FrameParams(bounces=0, ao=GtaoParams(), layers=2, overscan=0.125))

    needed = runtime.memory.needed(make)
    gc.collect()
    before, shared = runtime.memory.used, runtime.transient.held
    made = make()
    assert runtime.memory.used - before == pytest.approx(needed, abs=ALIGNMENT)
    assert needed > 0
    del made
    gc.collect()
    # What passes share stays for the next ones.
    assert runtime.memory.used - runtime.transient.held == before - shared


def test_a_piece_that_is_too_large_is_refused(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runtime.memory, "largest", MEBI)
    with pytest.raises(DeviceMemoryError, match=r"no room for 4\.\d MiB in one piece"):
        runtime.plane(1, (1024, 1024))


def test_a_driver_without_memory_is_reported(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    cl = opencl()

    def refuse(*_: Any, **__: Any) -> None:
        raise cl.MemoryError("clCreateBuffer failed: MEM_OBJECT_ALLOCATION_FAILURE")

    gc.collect()
    before = runtime.memory.used
    monkeypatch.setattr(cl, "Buffer", refuse)
    with pytest.raises(DeviceMemoryError, match=r"the driver has no room for 1\.0 MiB more"):
        runtime.array(np.zeros(MEBI, np.uint8))
    gc.collect()
    assert runtime.memory.used == before


def resident() -> float:
    """Return the memory of this process in MiB."""
    status = Path("/proc/self/status").read_text()
    return float(re.findall(r"VmRSS:\s*(\d+)", status)[0]) / 1024


@pytest.mark.parametrize("frames", [60, pytest.param(10_000, marks=pytest.mark.slow)])
def test_memory_stays_flat_frame_after_frame(runtime: Runtime, frames: int) -> None:
    def draw(number: int) -> None:
        camera = gi.Camera.look_at((0.1 * np.sin(number), 1.0, 3.4), (0, 1, 0), width=48, height=32)
        render(BOX.scene, camera, BOX.lights, bounces=0, shadow_size=64, runtime=runtime)

    for number in range(20):  # what is made once is made
        draw(number)
    gc.collect()
    before, taken = resident(), runtime.memory.used
    for number in range(frames):
        draw(number)
    gc.collect()
    assert runtime.memory.used == taken
    # The allocator keeps a few pages; 1 KiB a frame would be a leak.
    assert resident() - before < 4.0 + frames / 1024
