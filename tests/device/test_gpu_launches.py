"""What the library launches otherwise on a GPU: other groups, other switches, the same bits."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh

import ssgi_cl as gi
from ssgi_cl.core.errors import DeviceError, DeviceMemoryError
from ssgi_cl.device.drivers import KernelVariant
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.techniques.multires import final_gather
from ssgi_cl.techniques.vpl.packed_vpls import BATCH


def gpu(runtime: Runtime) -> Runtime:
    own = Runtime(runtime.info, KernelVariant(1, "buffer"))
    own.info = replace(own.info, kind="gpu")
    return own


@pytest.fixture(scope="module")
def as_gpu(runtime: Runtime) -> Runtime:
    """The default device, driven as if it were a GPU."""
    return gpu(runtime)


def drawn(runtime: Runtime) -> list[np.ndarray]:
    made = cornell_box()
    gbuffer = gi.rasterize.gbuffer(made.scene, made.camera(100, 70), layers=2, attributes="all", runtime=runtime)
    lit = gi.rasterize.rsm(made.scene, made.lights[0], size=32, runtime=runtime)  # type: ignore[arg-type]
    large = gi.rasterize.rsm(made.scene, made.lights[0], size=96, runtime=runtime)  # type: ignore[arg-type]
    return [
        np.asarray(gbuffer.depth),
        np.asarray(gbuffer.normal),
        gi.gtao(gbuffer, radius=0.1, runtime=runtime),
        gi.multires_splat(gbuffer, lit, 300, runtime=runtime),
        gi.multires_splat(gbuffer, large, 3 * BATCH, runtime=runtime),  # a pass for all three batches, or each
        np.asarray(gi.render(made.scene, made.camera(72, 54), made.lights, preset="low", runtime=runtime).image),
    ]


def test_a_gpu_gives_the_bits_of_a_processor(runtime: Runtime, as_gpu: Runtime) -> None:
    for found, wanted in zip(drawn(as_gpu), drawn(runtime), strict=True):
        np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize("dealt", [0, 1 << 14])
def test_launches_of_many_rays_are_split(runtime: Runtime, monkeypatch: pytest.MonkeyPatch, dealt: int) -> None:
    """As on large images, where one would take longer than a display's driver lets it."""
    made = cornell_box()
    images, launches = [], []
    for device, at_once in ((runtime, 1 << 24), (gpu(runtime), 1 << 24), (gpu(runtime), 5000)):
        monkeypatch.setattr(final_gather, "RAYS_AT_ONCE", at_once)
        monkeypatch.setattr(final_gather, "MOST_DEALT", dealt)
        frame = gi.render(made.scene, made.camera(61, 47), made.lights, edges=0, runtime=device)
        images.append(np.asarray(frame.image))
        launches.append(sum(each.name == "final_gather" and not each.skipped for each in frame.passes))
    assert launches[2] > launches[1] > 0
    np.testing.assert_array_equal(images[1], images[0])
    np.testing.assert_array_equal(images[2], images[0])


FILLS = 4096
"""Work-items that a launch has to have, else a GPU waits for one after the other."""


@pytest.mark.slow
def test_few_launches_of_a_frame_do_not_fill_a_gpu(as_gpu: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    """All light in 400 x 300 pixels, once surfels and maps are kept: 24 of 64 launches."""
    launches: list[tuple[str, int]] = []

    def record(name: str, _: Any, items: int = 0) -> None:
        if items > 0:  # else it is a copy
            launches.append((name, items))

    monkeypatch.setattr(as_gpu, "record", record)
    made = cornell_box()
    for step in range(3):
        launches.clear()
        eye = np.eye(4)
        eye[0, 3] = 0.01 * step
        camera = made.camera(400, 300)
        gi.render(made.scene, replace(camera, view=eye @ camera.view), made.lights, runtime=as_gpu)
    few = [launch for launch in launches if launch[1] < FILLS]
    assert len(launches) > 50
    assert len(few) < 25, few
    assert min(items for _, items in launches) >= 64


def test_a_gpu_clips_the_triangles_of_a_group_in_turns(runtime: Runtime, as_gpu: Runtime) -> None:
    """A camera in a tunnel, all sides of which reach behind it: more than a group has rings for."""
    tunnel = gi.rasterize.load_scene(trimesh.creation.cylinder(radius=1.0, height=10.0, sections=64))
    camera = gi.Camera.look_at((0.1, 0.2, 0.0), (0.5, 0.3, -2.0), yfov=2.2, width=90, height=61)
    found, wanted = (gi.rasterize.gbuffer(tunnel, camera, runtime=device) for device in (as_gpu, runtime))
    assert np.isfinite(np.asarray(wanted.depth)).all()
    for name in ("depth", "normal"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=name)


COUNT = """
#include "common/gbuffer.clh"
__kernel void count(__global int *restrict found, const int2 size)
{
    const int x = (int)get_global_id(0), y = (int)get_global_id(1);
    if (x < size.x && y < size.y) {
        found[y * size.x + x] = (int)(get_local_size(0) * get_local_size(1));
    }
}
"""


@pytest.mark.parametrize(("largest", "group"), [(1024, 64), (64, 64), (63, 32), (20, 16), (7, 4), (1, 1)])
@pytest.mark.parametrize("rows", [3, 21])
def test_a_kernel_of_many_registers_gets_smaller_groups(as_gpu: Runtime, largest: int, group: int, rows: int) -> None:
    kernel: Kernel = as_gpu.kernel_from_text("count", COUNT)
    assert kernel.largest_group >= 64
    kernel.largest_group = largest  # as a driver says of a kernel that takes many registers
    found = as_gpu.array(np.zeros((rows, 13), np.int32))
    kernel.run((rows, 13), found=found)
    assert set(found.download()) == {group}


def test_a_group_of_a_fixed_size_is_refused_where_it_does_not_fit(as_gpu: Runtime) -> None:
    kernel = as_gpu.kernel_from_text("count", COUNT)
    kernel.largest_group = 32
    with pytest.raises(DeviceError, match="runs count with work-groups of at most 32 work-items: expected 64"):
        kernel.run((1, 1), grid=(1, 64), local=(1, 64), found=as_gpu.array(np.zeros(1, np.int32)))


def test_no_piece_of_memory_is_larger_than_the_device_has(runtime: Runtime) -> None:
    own = Runtime(runtime.info, runtime.variant)
    own.memory.largest = 128 << 10
    made = cornell_box()
    small, large = (made.camera(*size) for size in ((64, 48), (400, 300)))
    depth = np.full((48, 64), 2.0, np.float32)
    np.testing.assert_array_equal(
        gi.gtao(gi.GBuffer(camera=small, depth=depth), radius=0.1, runtime=own),
        gi.gtao(gi.GBuffer(camera=small, depth=depth), radius=0.1, runtime=runtime),
    )
    with pytest.raises(DeviceMemoryError, match=r"MiB in one piece, which has at most 0\.1 MiB"):
        gi.gtao(gi.GBuffer(camera=large, depth=np.ones((300, 400), np.float32)), radius=0.1, runtime=own)
