"""The runtime: devices by name, forms, programs, memory and times."""

from __future__ import annotations

import gc
import time
from importlib.resources import files

import numpy as np
import pytest

from ssgi_cl.core.errors import DeviceError, DeviceMemoryError, KernelBuildError
from ssgi_cl.device import drivers, sources
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.drivers import KernelVariant
from ssgi_cl.device.prepared import MOST_PREPARED
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA
from ssgi_cl.device.timing import PassTime

SIZES = [(1, 1), (16, 16), (33, 100)]
ADD = """
#include "common/gbuffer.clh"
#ifndef TERM
#error "TERM must be defined by the host"
#endif
__kernel void add(ssgi_plane source, __global float *restrict sum, const int2 size)
{
    const int x = ssgi_first_column();
    const int y = (int)get_global_id(1);
    if (x >= size.x || y >= size.y) {
        return;
    }
    ssgi_store(ssgi_load(source, size, 0, x, y) + (float)TERM, sum, size, 0, x, y, 0.0f);
}
"""


@pytest.fixture
def fresh(runtime: Runtime) -> Runtime:
    """The device under test with nothing built yet."""
    return Runtime(runtime.info, runtime.variant)


def test_opening_twice_gives_the_same_runtime(runtime: Runtime) -> None:
    assert Runtime.open() is runtime
    assert Runtime.open(runtime.info.label) is runtime
    assert runtime.info.label in repr(runtime)


def test_an_unknown_device_is_refused_with_the_list_of_all(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DeviceError, match=r"no such OpenCL device\. Devices found:") as caught:
        Runtime.open("no such thing")
    for info in drivers.devices():
        assert info.label in str(caught.value)
    monkeypatch.setenv("SSGI_CL_DEVICE", "no such thing")
    with pytest.raises(DeviceError, match="no such thing: no such OpenCL device"):
        Runtime.open()


def test_a_variant_that_no_kernel_has_is_refused(runtime: Runtime) -> None:
    with pytest.raises(ValueError, match="variant is 4 lanes on 'buffer': expected 1, 8 or 16"):
        Runtime.open(lanes=4)
    with pytest.raises(ValueError, match="variant is 8 lanes on 'image'"):
        Runtime.open(lanes=8, storage="image")


def test_a_variant_that_the_device_cannot_run_is_refused(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    speeds: dict[str, float | str] = {"1 lane, buffer": 1.0, "16 lanes, buffer": "it crashes"}
    broken = drivers.DeviceInfo("none.icd", 0, 0, "Broken", "cpu", 1, speeds)
    monkeypatch.setattr(drivers, "choose", lambda name, loaded: broken)
    with pytest.raises(DeviceError, match="Broken cannot run 16 lanes, buffer: it crashes"):
        Runtime.open(lanes=16)
    with pytest.raises(DeviceError, match="this process already uses the driver"):
        Runtime.open()
    assert str(KernelVariant(1, "image")) == "1 lane, image"


def test_forcing_a_form_builds_kernels_so(variant_runtime: Runtime) -> None:
    kernel = variant_runtime.kernel_from_text(
        "form",
        """__kernel void form(__global int *restrict to, const int2 size)
        {
            to[0] = SSGI_LANES;
            to[1] = SSGI_IMAGES;
        }
        """,
    )
    result = variant_runtime.empty(2, np.int32)
    kernel.run((1, 1), grid=(1, 1), local=(1, 1), to=result)
    variant = variant_runtime.variant
    assert result.download().tolist() == [variant.lanes, int(variant.storage == "image")]
    assert Runtime.open(lanes=variant.lanes, storage=variant.storage) is variant_runtime


def test_the_same_text_with_the_same_options_is_built_once(fresh: Runtime) -> None:
    first, second = (fresh.kernel_from_text("add", ADD, {"TERM": 1}) for _ in range(2))
    assert fresh.builds == 1
    assert first._kernel is not second._kernel, "each has arguments of its own"
    fresh.kernel_from_text("add", ADD, {"TERM": 2})
    assert fresh.builds == 2
    fresh.kernel_from_text("add", ADD + "\n", {"TERM": 2}, [CAMERA])
    assert fresh.builds == 3


def test_a_build_error_names_the_file_and_the_line(fresh: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    flatten = sources.flatten

    def damaged(path: str, prelude: str = "") -> str:
        return flatten(path, prelude).replace("1.0f + own", "1.0f + owned")

    monkeypatch.setattr(sources, "flatten", damaged)
    # The line is that of the word in the file, whatever was included before it.
    file = files("ssgi_cl.kernels").joinpath("probe", "probe_gather.cl")
    lines = file.read_text(encoding="utf-8").splitlines()
    line = next(i for i, text in enumerate(lines, start=1) if "1.0f + own" in text)
    with pytest.raises(KernelBuildError) as caught:
        fresh.kernel("probe/probe_gather.cl")
    message = str(caught.value)
    assert f"probe/probe_gather.cl:{line}:" in message
    label = fresh.info.label
    assert message.startswith(f"kernels/probe/probe_gather.cl does not compile on {label}")
    assert f"-DSSGI_LANES={fresh.variant.lanes}" in message


def test_a_missing_macro_and_a_missing_kernel_are_build_errors(fresh: Runtime) -> None:
    with pytest.raises(KernelBuildError, match="TERM must be defined by the host"):
        fresh.kernel_from_text("add", ADD)
    with pytest.raises(KernelBuildError, match="kernel text 'other' has no kernel other"):
        fresh.kernel_from_text("other", ADD, {"TERM": 1})


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("shared", [True, False])
def test_planes_come_back_to_the_bit(fresh: Runtime, size: Size, shared: bool, rng: np.random.Generator) -> None:
    if shared and not fresh.shares_memory:
        pytest.skip("the device has memory of its own")
    fresh.shares_memory = shared
    bits = rng.integers(0, 2**32, (3, *size), dtype=np.uint64).astype(np.uint32)
    values = bits.view(np.float32)  # NaNs, infinities and subnormals too
    plane = fresh.plane(3, size, 7.0)
    assert (plane.download() == 7.0).all()
    plane.upload(values)
    np.testing.assert_array_equal(plane.download().view(np.uint32), bits)
    # Strided on both sides: channels last in numpy, first on the device.
    plane.upload(np.moveaxis(np.ascontiguousarray(np.moveaxis(values, 0, -1)), -1, 0))
    out = np.zeros((*size, 3), np.float32)
    returned = plane.download(np.moveaxis(out, -1, 0))
    assert np.shares_memory(returned, out)
    np.testing.assert_array_equal(out.view(np.uint32), np.moveaxis(bits, 0, -1))


def test_images_are_copied_from_plane_to_plane(runtime: Runtime, rng: np.random.Generator) -> None:
    values = rng.random((3, 5, 7), np.float32)
    source, target = runtime.plane(3, (5, 7)), runtime.plane(4, (5, 7), 2.0)
    source.upload(values)
    target.copy_image(1, source, 2)
    wanted = np.full((4, 5, 7), 2.0, np.float32)
    wanted[1:3] = values[:2]
    np.testing.assert_array_equal(target.download(), wanted)
    with pytest.raises(ValueError, match=r"source has size \(7, 5\): expected \(5, 7\)"):
        target.copy_image(0, runtime.plane(1, (7, 5)))


@pytest.mark.parametrize("size", SIZES)
def test_both_roads_to_the_device_give_bit_identical_results(
    variant_runtime: Runtime, size: Size, rng: np.random.Generator
) -> None:
    values = rng.standard_normal((1, *size)).astype(np.float32)
    results = []
    for shared in {variant_runtime.shares_memory, False}:
        runtime = Runtime(variant_runtime.info, variant_runtime.variant)
        runtime.shares_memory = shared
        start, end = runtime.plane(1, size), runtime.plane(1, size)
        start.upload(values)
        kernel = runtime.kernel_from_text("add", ADD, {"TERM": 3})
        kernel.run(size, source=start, sum=end)
        kernel.run(size, source=end, sum=start)
        start.upload(end.download())
        kernel.run(size, source=start, sum=end)
        results.append(end.download())
        with end._mapped() as memory:  # the guard is whole
            inner = np.zeros_like(memory)
            inner[1 : 1 + size[0], : size[1]] = results[-1][0]
            np.testing.assert_array_equal(memory, inner)
    np.testing.assert_array_equal(results[0], values + np.float32(3) + np.float32(3))
    np.testing.assert_array_equal(results[-1], results[0])


@pytest.mark.parametrize("count", [1, 3, 1000])
@pytest.mark.parametrize("dtype", [np.float32, np.int32, np.uint8])
def test_arrays_come_back_to_the_bit(
    runtime: Runtime, count: int, dtype: type[np.generic], rng: np.random.Generator
) -> None:
    size = np.dtype(dtype).itemsize
    values = rng.integers(0, 256, count * size).astype(np.uint8).view(dtype)
    array = runtime.array(values)
    assert array.download().tobytes() == values.tobytes()
    part = values[: count // 2]
    for give in (array.upload, array.send):
        given = part[::-1].copy()
        give(given)
        given[:] = 0  # which the device no longer looks at
        assert array.download()[: count // 2].tobytes() == part[::-1].tobytes()
        with pytest.raises(ValueError, match="expected at most"):
            give(np.zeros(count + 1, dtype))
        array.upload(values)


def test_memory_is_counted(fresh: Runtime) -> None:
    fresh.array(np.zeros(100, np.float32))
    assert fresh.allocated_bytes == 400
    fresh.plane(2, (3, 5))
    assert fresh.allocated_bytes == 400 + (2 * 3 + 2) * (16 + 16) * 4
    assert fresh.empty(0, np.float32).count == 1, "an empty array takes memory all the same"


def test_more_memory_than_there_is_ends_in_an_error(fresh: Runtime) -> None:
    with pytest.raises(DeviceError, match="no room for"):
        fresh.plane(1 << 20, (1 << 14, 1 << 14))


def test_passes_are_timed_by_name_in_their_order(runtime: Runtime) -> None:
    start, end = runtime.plane(1, (64, 64)), runtime.plane(1, (64, 64))
    first, second, fourth = (
        runtime.kernel_from_text(name, ADD.replace("void add(", f"void {name}("), {"TERM": 1})
        for name in ("first", "second", "fourth")
    )
    with runtime.frame():
        runtime.skip("none", "nothing to do")
        first.run((64, 64), source=start, sum=end)
        with runtime.frame():
            second.run((64, 64), source=end, sum=start)
        runtime.skip("third", "the same as before")
        fourth.run((64, 64), source=start, sum=end)
    times = [time for time in runtime.times() if time.name != "copy to image"]
    assert [time.name for time in times] == ["none", "first", "second", "third", "fourth"]
    assert times[0] == PassTime("none", 0.0, "nothing to do")
    assert all(time.skipped or 0.0 < time.ms < 1e4 for time in times)
    with runtime.frame():
        pass
    assert runtime.times() == []


LONG = """
__kernel void spin(__global float *restrict sums, const int turns, const int2 size)
{
    float sum = 1.0f;
    for (int i = 0; i < turns; ++i) {
        sum = sum * 0.999f + 0.5f; // each waits for the one before
    }
    sums[get_global_id(0)] = sum;
}
"""


def test_times_are_asked_for_and_waited_for_without_work_of_the_host(runtime: Runtime) -> None:
    kernel = runtime.kernel_from_text("spin", LONG)
    sums = runtime.empty(64, np.float32)
    with runtime.frame():
        kernel.run((1, 64), grid=(1, 64), local=(1, 1), sums=sums, turns=10)
    runtime.finish()
    done = runtime.times_if_done()
    assert done is not None
    assert [each.name for each in done] == ["spin"]
    with runtime.frame():
        kernel.run((1, 64), grid=(1, 64), local=(1, 1), sums=sums, turns=8_000_000)
    start, busy = time.perf_counter(), time.thread_time()
    assert runtime.times_if_done() is None
    asked = time.perf_counter() - start
    times = runtime.times()
    assert asked < 0.25 * times[0].ms * 1e-3
    # A thread that asked again and again would be busy nearly all the time.
    assert time.thread_time() - busy < 0.2 * times[0].ms * 1e-3
    assert times[0].ms > 100.0  # some 0.02 s of each work-item on a processor
    assert runtime.times_if_done() == times


def test_a_frame_ends_when_its_body_raises(runtime: Runtime) -> None:
    def fail() -> None:
        with runtime.frame():
            runtime.skip("before", "it stops")
            raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"):
        fail()
    with runtime.frame():
        runtime.skip("after", "idle")
    assert [time.name for time in runtime.times()] == ["after"]


@pytest.mark.parametrize("local", [(1, 1), (1, 5), (3, 2), (2, 8)])
def test_any_work_group_gives_bit_identical_results(
    variant_runtime: Runtime, local: Size, rng: np.random.Generator
) -> None:
    size = (7, 50)
    start, end = variant_runtime.plane(1, size), variant_runtime.plane(1, size)
    values = rng.standard_normal((1, *size)).astype(np.float32)
    start.upload(values)
    kernel = variant_runtime.kernel_from_text("add", ADD, {"TERM": 1})
    kernel.run(size, local=local, source=start, sum=end)
    np.testing.assert_array_equal(end.download(), values + np.float32(1))


def test_nothing_is_queued_for_an_empty_image(runtime: Runtime) -> None:
    plane = runtime.plane(1, (4, 4))
    kernel = runtime.kernel_from_text("add", ADD, {"TERM": 1})
    with runtime.frame():
        kernel.run((0, 4), source=plane, sum=plane)
    assert runtime.times() == []


def test_what_is_prepared_is_made_once_and_the_oldest_goes(fresh: Runtime) -> None:
    made: list[int] = []

    def make(n: int) -> object:
        return fresh.prepared(n, lambda: made.append(n) or object())  # type: ignore[func-returns-value]

    first = make(0)
    assert make(0) is first
    for n in range(1, MOST_PREPARED + 1):
        make(n)
        assert make(1) is make(1)
    assert made == list(range(MOST_PREPARED + 1))
    assert make(0) is not first


def prepared_plane(runtime: Runtime, key: int) -> Plane:
    return runtime.prepared(key, lambda: runtime.plane(1, (64, 1024)))


def test_what_is_kept_is_bounded_in_bytes(fresh: Runtime) -> None:
    fresh.memory.keep = 1 << 20
    for n in range(20):
        prepared_plane(fresh, n)
        assert fresh.memory.kept <= fresh.memory.keep
    latest, allocated = prepared_plane(fresh, 19), fresh.allocated_bytes
    assert prepared_plane(fresh, 19) is latest
    assert fresh.allocated_bytes == allocated


def test_what_is_kept_can_be_forgotten(fresh: Runtime) -> None:
    prepared_plane(fresh, 1)
    assert fresh.memory.kept > 64 * 1024 * 4
    fresh.forget()
    assert fresh.memory.kept == fresh.memory.used == 0
    first = prepared_plane(fresh, 1)
    assert prepared_plane(fresh, 1) is first


def test_a_call_keeps_what_it_uses_however_much_that_is(fresh: Runtime) -> None:
    fresh.memory.keep = 1 << 20

    def work() -> None:
        made = [prepared_plane(fresh, n) for n in range(20)]
        again = [fresh.prepared(n, lambda: None) for n in range(20)]
        assert all(a is b for a, b in zip(made, again, strict=True))

    fresh.exclusively(work)


def test_what_a_caller_holds_does_not_push_out_what_is_kept(fresh: Runtime) -> None:
    fresh.memory.keep = 1 << 20
    held = [fresh.plane(1, (64, 1024)) for _ in range(20)]
    first = prepared_plane(fresh, 1)
    prepared_plane(fresh, 2)
    assert prepared_plane(fresh, 1) is first
    assert fresh.memory.used > 20 * 64 * 1024 * 4
    assert fresh.memory.peak == fresh.memory.used
    del held
    assert fresh.memory.used < 3 * 70 * 1100 * 4


def test_what_is_of_a_thing_goes_with_it(fresh: Runtime) -> None:
    class Thing:
        pass

    thing = Thing()
    fresh.prepared("a", lambda: fresh.plane(1, (64, 64)), of=thing)
    assert fresh.memory.used > 0
    del thing
    assert fresh.memory.used == 0


def test_one_piece_larger_than_the_device_allows_is_refused_before_the_driver_is_asked(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runtime.memory, "largest", 1 << 20)
    gc.collect()
    before = runtime.memory.used
    with pytest.raises(DeviceMemoryError, match=r"2\.0 MiB in one piece, .* at most 1\.0 MiB"):
        runtime.empty(1 << 19, np.float32)
    assert runtime.memory.used == before


def test_keep_is_an_argument_of_open(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    before = runtime.memory.keep
    monkeypatch.setattr(runtime.memory, "keep", before)
    variant = {"lanes": runtime.variant.lanes, "storage": runtime.variant.storage}
    assert Runtime.open(runtime.info.label, **variant).memory.keep == before  # type: ignore[arg-type]
    kept = Runtime.open(runtime.info.label, keep=1 << 20, **variant)  # type: ignore[arg-type]
    assert kept is runtime
    assert runtime.memory.keep == 1 << 20
    for wrong, error in ((-1, ValueError), (0.5, TypeError)):
        with pytest.raises(error, match="keep is"):
            Runtime.open(runtime.info.label, keep=wrong, **variant)  # type: ignore[arg-type]


def test_a_kernel_of_fewer_lanes_covers_the_image_all_the_same(runtime: Runtime) -> None:
    # Wider than what work-groups round up to.
    size = (3, 2000)
    given = np.random.default_rng(2).random((3, *size), dtype=np.float32)
    planes = [runtime.plane(3, size, outside) for outside in (0.0, 0.0, 1.0)]
    planes[0].upload(given)
    kernel = runtime.kernel("blended/blended.cl", {"BLENDED_STEP": 2}, most_lanes=8)
    assert kernel.lanes == min(runtime.variant.lanes, 8)
    kernel.run(size, radiance=planes[0], over=planes[1], through=planes[2])
    np.testing.assert_array_equal(planes[1].download(), given)


def test_compilers_print_no_warnings(runtime: Runtime, capfd: pytest.CaptureFixture[str]) -> None:
    unused = f"u{time.time_ns()}"  # no cache has this program
    text = f"__kernel void k(__global int *restrict a, const int2 size) {{ int {unused} = 1.5f; a[0] = {unused}; }}"
    runtime.kernel_from_text("k", text)
    assert capfd.readouterr() == ("", "")
    with pytest.raises(KernelBuildError, match="undeclared"):
        runtime.kernel_from_text("k", text.replace("a[0] =", "a[0] = nothing +"))
