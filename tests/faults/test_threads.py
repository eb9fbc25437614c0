"""Several threads on one device, and processes that were forked from one that uses it."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import weakref
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.errors import DeviceError, DeviceMemoryError
from ssgi_cl.device import host_memory
from ssgi_cl.device.process import check_not_forked
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.render import Renderer
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES

BOX = BUILTIN_SCENES["cornell_box"]()
CAMERAS = [gi.Camera.look_at((0.1 * i - 0.4, 1, 3.4), (0, 1, 0), width=40, height=30) for i in range(8)]


def drawn(runtime: Runtime, camera: gi.Camera = CAMERAS[0], made: Any = BOX, **options: Any) -> gi.Frame:
    """Return a frame with small shadow maps."""
    given = {"bounces": 0, "shadow_size": 32, **options}
    return gi.render(made.scene, camera, given.pop("lights", made.lights), runtime=runtime, **given)


def renderer(runtime: Runtime, shadow_size: int) -> Renderer:
    """Return a renderer of direct light alone."""
    return Renderer(runtime, CAMERAS[0].size, FrameParams(bounces=0, ao=False, shadow_size=shadow_size))


@pytest.mark.parametrize("calls", [200, pytest.param(10_000, marks=pytest.mark.slow)])
def test_eight_threads_get_what_one_gets(runtime: Runtime, calls: int) -> None:
    gbuffers = [gi.rasterize.gbuffer(BOX.scene, camera, runtime=runtime) for camera in CAMERAS]

    def occlusion(number: int) -> Any:
        return gi.gtao(gbuffers[number % 8], radius=0.3, runtime=runtime)

    expected = [occlusion(number) for number in range(8)]
    with ThreadPoolExecutor(8) as pool:
        for number, found in enumerate(pool.map(occlusion, range(calls))):
            np.testing.assert_array_equal(found, expected[number % 8])


def test_threads_render_what_one_renders_and_each_sees_its_own_passes(runtime: Runtime) -> None:
    modes: list[dict[str, Any]] = [{"indirect": "gather"}, {}]

    def frame(number: int) -> gi.Frame:
        return drawn(runtime, CAMERAS[number % 2], rsm_size=32, skips=False, **modes[number // 2 % 2])

    expected = [frame(number) for number in range(4)]
    with ThreadPoolExecutor(4) as pool:
        for number, found in enumerate(pool.map(frame, range(24))):
            right = expected[number % 4]
            np.testing.assert_array_equal(found.radiance, right.radiance)
            assert [p.name for p in found.passes] == [p.name for p in right.passes]


def test_threads_with_renderers_of_their_own(runtime: Runtime) -> None:
    def pictures(number: int) -> list[Any]:
        draw = renderer(runtime, 32)
        return [draw(BOX.scene, camera, BOX.lights).image for camera in CAMERAS[number:][:3]]

    expected = [pictures(number) for number in range(4)]
    with ThreadPoolExecutor(4) as pool:
        for found, right in zip(pool.map(pictures, range(4)), expected, strict=True):
            np.testing.assert_array_equal(found, right)


def test_a_forked_process_is_told_at_once(runtime: Runtime) -> None:
    gbuffer = gi.rasterize.gbuffer(BOX.scene, CAMERAS[0], runtime=runtime)
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        answers = []
        for call in (
            lambda: gi.gtao(gbuffer, radius=0.3),
            Runtime.open,
            lambda: runtime.plane(1, (4, 4)),
            lambda: runtime.exclusively(lambda: None),
        ):
            try:
                call()
                answers.append("nothing")
            except DeviceError as error:
                answers.append(str(error))
        os.write(writing, "\n".join(answers).encode())
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as answers:
        lines = answers.read().splitlines()
    assert os.waitpid(child, 0)[1] == 0
    assert len(lines) == 4
    assert all("was forked" in line and '"spawn"' in line for line in lines), lines
    check_not_forked()  # the parent goes on
    assert gi.gtao(gbuffer, radius=0.3, runtime=runtime).shape == gbuffer.size


@pytest.mark.slow
def test_a_process_forked_before_any_device_was_opened_may_open_one() -> None:
    code = (
        "import os, ssgi_cl\n"
        "if os.fork() == 0: ssgi_cl.Runtime.open(); print('opened', flush=True); os._exit(0)\n"
        "os.wait()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout.strip() == "opened", done.stderr


def test_a_new_radius_a_frame_keeps_memory_within_its_bound(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runtime.memory, "keep", 24 << 20)
    for number in range(40):
        drawn(runtime, ao_radius=0.2 + 0.001 * number, indirect="gather", rsm_size=32)
        assert runtime.memory.kept <= 24 << 20


def test_a_scene_goes_with_its_last_reference(runtime: Runtime) -> None:
    gc.collect()
    drawn(runtime)
    # What passes share stays, and may grow in the first frames.
    before = runtime.memory.used - runtime.transient.held
    for _ in range(3):
        made = BUILTIN_SCENES["cornell_box"]()
        gone = weakref.ref(made.scene)
        for outputs in ("ao",), ("image",):
            drawn(runtime, made=made, outputs=outputs)
        del made
        assert gone() is None
        assert runtime.memory.used - runtime.transient.held == before


def let_all_go(runtime: Runtime) -> None:
    runtime._prepared.clear()
    gc.collect()


def test_more_shadow_maps_than_there_is_room_for_are_refused_before_any_work(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    let_all_go(runtime)
    lights = [gi.PointLight((0.0, 1.0, 0.01 * i), (1.0, 1.0, 1.0)) for i in range(60)]
    draw = renderer(runtime, 256)
    first = draw(BOX.scene, CAMERAS[0], lights[:1]).radiance
    monkeypatch.setattr(runtime.memory, "limit", runtime.memory.used + (40 << 20))
    used = runtime.memory.used
    with pytest.raises(DeviceMemoryError, match=r"for 360 shadow maps .* of 256 x 256 texels"):
        draw(BOX.scene, CAMERAS[0], lights)
    assert runtime.memory.used <= used
    np.testing.assert_array_equal(draw(BOX.scene, CAMERAS[0], lights[:1]).radiance, first)


def test_maps_of_lights_that_are_gone_are_let_go(runtime: Runtime) -> None:
    lights = [gi.SpotLight((0.0, 1.0, 0.01 * i), (0.0, -1.0, 0.0), 0.5, (1.0, 1.0, 1.0)) for i in range(8)]
    draw = renderer(runtime, 64)
    draw(BOX.scene, CAMERAS[0], lights[:1])
    before = runtime.memory.used
    draw(BOX.scene, CAMERAS[0], lights)
    assert runtime.memory.used > before + 7 * 64 * 64 * 4
    draw(BOX.scene, CAMERAS[0], lights[:1])
    gc.collect()
    assert runtime.memory.used == before


@pytest.mark.skipif(host_memory.spare(1 << 30) < 1 << 30, reason="needs 1 GiB")
def test_a_device_on_the_host_leaves_it_room(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    if not runtime.shares_memory:
        pytest.skip("the device has memory of its own")
    assert runtime.memory.limit <= host_memory.share()
    monkeypatch.setattr(host_memory, "spare", lambda size=0: 3 << 20)
    plane = runtime.plane(1, (256, 1024))
    with pytest.raises(DeviceMemoryError, match=r"the host can spare 3\.0 MiB"):
        runtime.plane(4, (256, 1024))
    monkeypatch.setattr(host_memory, "spare", lambda size=0: 1 << 19)
    with pytest.raises(DeviceMemoryError, match=r"a result of 1\.0 MiB"):
        plane.download()


def test_limits_of_the_process_are_obeyed() -> None:
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_AS, (6 << 30, 6 << 30))\n"
        "from ssgi_cl.device import host_memory; print(host_memory.share(), host_memory.spare(1 << 30))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=True)
    share, spare = map(int, done.stdout.split())
    assert share <= 6 << 30
    assert spare < 6 << 30


@pytest.mark.slow
def test_thirty_modes_of_five_scenes_never_fail_for_memory(runtime: Runtime, monkeypatch: pytest.MonkeyPatch) -> None:
    let_all_go(runtime)
    scenes = [made() for made in list(BUILTIN_SCENES.values())[:5]]
    modes: list[dict[str, Any]] = [
        {**light, **extra}
        for light in (
            *({"ao": method} for method in ("gtao", "ssao", "hbao", "bitmask_ao")),
            *({"indirect": method} for method in ("multires", "vpl", "gather", "ssdo")),
            {"indirect": "ssdo", "method": "points"},
            {"indirect": "multires", "ao": "ssao"},
        )
        for extra in ({}, {"layers": 2}, {"overscan": 0.2})
    ]

    def draw(made: Any, mode: dict[str, Any]) -> gi.Frame:
        return drawn(runtime, made.camera(160, 120), made, shadow_size=256, rsm_size=128, vpls=256, **mode)

    base, largest = runtime.memory.used, 0
    for made in scenes:  # what the greatest mode takes by itself
        draw(made, {"indirect": "vpl", "layers": 2})
        largest = max(largest, runtime.memory.used - base)
        let_all_go(runtime)
    expected = [draw(made, modes[0]).radiance for made in scenes]
    let_all_go(runtime)
    keep = largest // 2
    monkeypatch.setattr(runtime.memory, "limit", base + 2 * largest)
    monkeypatch.setattr(runtime.memory, "keep", keep)
    for mode in modes:
        for made in scenes:
            draw(made, mode)
    assert len(modes) == 30
    assert runtime.memory.used <= runtime.memory.limit
    for made, radiance in zip(scenes, expected, strict=True):
        np.testing.assert_array_equal(draw(made, modes[0]).radiance, radiance)
    gi.gtao(gi.rasterize.gbuffer(BOX.scene, CAMERAS[0], runtime=runtime), runtime=runtime)
    assert runtime.memory.kept <= keep
