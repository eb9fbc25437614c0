"""Kernels compiled for graphics processors, and their recorded figures."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ssgi_cl.bench import gpu_static
from ssgi_cl.bench.gpu_compile import AMD, INTEL, NVIDIA, Usage, missing, usages, versions, warps
from ssgi_cl.core.errors import KernelBuildError
from ssgi_cl.device import sources
from ssgi_cl.device.constants import SSGI_GROUP
from ssgi_cl.device.requirements import LOCAL_BYTES

DEVICES = (AMD, *NVIDIA, INTEL)
SOME = Usage(registers=64, spills=0, scratch=16, resident=12, most=16)


def compiled(text: str) -> dict[str, Usage]:
    lacking = [missing(device) for device in DEVICES if missing(device)]
    if lacking:
        pytest.skip(f"{lacking[0]} is not installed")
    return usages("k", text, {})


def test_a_plain_kernel_fills_every_device() -> None:
    found = compiled("__kernel void k(__global float *a) { a[get_global_id(0)] *= 2.0f; }")
    assert [*found] == [*DEVICES]
    for usage in found.values():
        assert (usage.spills, usage.scratch, usage.local, usage.resident) == (0, 0, 0, usage.most)
        assert usage.registers > 0


def test_an_array_that_a_variable_indexes_is_scratch() -> None:
    text = """__kernel void k(__global int *a, const int n) {
        int kept[100];
        for (int i = 0; i < 100; ++i) kept[i] = a[i + get_global_id(0)];
        for (int i = 0; i < n; ++i) kept[a[i]] ^= i;
        a[get_global_id(0)] = kept[n];
    }"""
    found = compiled(text)
    for usage in found.values():
        assert 400 <= usage.scratch < 500  # and what else is kept there


def test_values_beyond_the_registers_are_spills() -> None:
    count = 300  # of at most 255 registers; no value can be computed twice
    names = [f"v{i}" for i in range(count)]
    lines = [f"float {name} = a[g * {count} + {i}];" for i, name in enumerate(names)]
    lines += ["barrier(CLK_GLOBAL_MEM_FENCE);"]
    lines += [f"v{i} = v{i} * v{(7 * i + 3) % count} + v{(5 * i + 1) % count};" for i in range(count)] * 3
    lines += [f"a[g * {count} + {i}] = {name};" for i, name in enumerate(names)]
    body = "\n".join(lines)
    found = compiled(f"__kernel void k(__global float *a) {{ const int g = get_global_id(0); {body} }}")
    for device, usage in found.items():
        assert usage.spills > 0, device
        assert usage.resident <= usage.most // 2, device


def test_images_are_read_by_instructions_of_their_own() -> None:
    text = """__constant sampler_t s = CLK_NORMALIZED_COORDS_FALSE | CLK_FILTER_NEAREST;
        __kernel void k(__read_only image2d_t from, __global float *a) {
            a[get_global_id(0)] = read_imagef(from, s, (int2)((int)get_global_id(0), 3)).x;
        }"""
    found = compiled(text)
    for device, usage in found.items():
        assert (usage.spills, usage.scratch, usage.resident) == (0, 0, usage.most), device


def test_a_kernel_that_a_compiler_refuses_is_an_error() -> None:
    if all(missing(device) for device in DEVICES):
        pytest.skip("no compiler is installed")
    with pytest.raises(KernelBuildError, match=r"k does not compile by .*\n.*undeclared|k does not compile by ocloc"):
        usages("k", "__kernel void k(__global float *a) { a[0] = b; }", {})


@pytest.mark.parametrize(
    ("registers", "most", "resident"),
    # Of NVIDIA's calculator of occupancy: 65536 registers, 256 at a time, warps by fours.
    [(32, 64, 64), (33, 64, 48), (72, 64, 28), (88, 48, 20), (206, 64, 8), (255, 64, 8), (16, 32, 32)],
)
def test_warps_follow_from_registers(registers: int, most: int, resident: int) -> None:
    assert warps(registers, most) == resident


def test_the_worst_figures_count() -> None:
    other = replace(SOME, registers=32, scratch=20, resident=8)
    assert gpu_static.worst([SOME, other]) == replace(SOME, scratch=20, resident=8)


@pytest.mark.parametrize(
    ("now", "said"),
    [
        (SOME, []),
        (replace(SOME, registers=80, scratch=8, resident=16), []),
        (replace(SOME, scratch=20), ["k, buffer on gfx1030: scratch 20, before 16"]),
        (replace(SOME, spills=1), ["k, buffer on gfx1030: spills 1, before 0"]),
        (replace(SOME, resident=11), ["k, buffer on gfx1030: resident 11 of 16, before 12"]),
    ],
)
def test_what_is_worse_is_named(now: Usage, said: list[str]) -> None:
    assert gpu_static.worse({"k, buffer": {AMD: now}}, {"k, buffer": {AMD: SOME}}) == said


def test_a_kernel_without_a_record_has_to_be_clean() -> None:
    clean = replace(SOME, scratch=0, resident=8)
    assert gpu_static.worse({"k, buffer": {AMD: clean}}, {}) == []
    bad = replace(clean, scratch=4, resident=7)
    assert len(gpu_static.worse({"k, buffer": {AMD: bad}}, {})) == 2


def test_the_page_has_the_recorded_table() -> None:
    _, kept = gpu_static.recorded()
    assert gpu_static.markdown(kept) in gpu_static.PAGE.read_text("utf-8")


def test_every_kernel_is_recorded_on_every_device() -> None:
    _, kept = gpu_static.recorded()
    files = {path.rsplit("/", 1)[-1].removesuffix(".cl") for path in sources.kernel_names()}
    unknown = {kernel.rsplit(",", 1)[0] for kernel in kept} - files
    assert unknown == set(), "kernels that are gone: python -m ssgi_cl.bench.gpu_static --record"
    assert all([*devices] == [*DEVICES] for devices in kept.values())


@pytest.mark.slow
def test_kernels_are_those_of_a_gpu() -> None:
    (setup,) = {
        build.macros["RASTER_RUN"] for build in gpu_static.gpu_builds() if build.path == "raster/raster_setup.cl"
    }
    assert setup == 1  # triangle of a work-item; 256 on processors


@pytest.mark.slow
def test_no_kernel_takes_more_local_memory_than_a_device_has_to_have() -> None:
    taken = {build.path: build.kernel.local_bytes for build in gpu_static.gpu_builds()}
    assert taken["raster/raster_scan.cl"] == 4 * SSGI_GROUP
    assert taken["multires/cluster_order.cl"] == 2 * 6 * 4 * SSGI_GROUP
    assert max(taken.values()) <= LOCAL_BYTES


IN_LANES = {"reflect_mirror, image": 31}
"""Numbers of a wave, not of its work-items, that AMD keeps in lanes of registers: five images are 40 of them."""


def test_no_kernel_keeps_anything_in_memory() -> None:
    _, kept = gpu_static.recorded()
    for kernel, devices in kept.items():
        for device, usage in devices.items():
            assert usage.scratch == 0, (kernel, device)
            assert usage.spills <= (IN_LANES.get(kernel, 0) if device == AMD else 0), (kernel, device)


MORE = {"calibrate_copy": 1.15}
"""It does nothing but read and write: finding a place takes a tenth of its instructions."""


def test_reads_of_images_cost_what_reads_of_buffers_do() -> None:
    """Bytes of instructions, for AMD: at most a tenth more."""
    _, kept = gpu_static.recorded()
    for kernel, devices in kept.items():
        name, storage = kernel.rsplit(", ", 1)
        if storage == "buffer":
            cost = kept[f"{name}, image"][AMD].code / devices[AMD].code
            assert cost <= MORE.get(name, 1.1), kernel


@pytest.mark.slow
def test_no_kernel_is_worse_than_recorded() -> None:
    said, kept = gpu_static.recorded()
    if versions() != said:
        pytest.skip(f"compilers are {versions()}, recorded are {said}")
    found = dict(gpu_static.table(gpu_static.gpu_builds()))
    assert gpu_static.worse(found, kept) == []
