"""A frame that ends in an exception leaves nothing that later frames would take for true."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.render import Renderer
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.techniques.ao.gtao import GtaoParams

BOX = BUILTIN_SCENES["cornell_box"]()
CAMERAS = [gi.Camera.look_at((x, 1.0, 3.4), (0, 1, 0), width=40, height=30) for x in (-0.2, 0.3)]
MOVED = gi.SpotLight((0.3, 1.9, 0.2), (0.0, -1.0, 0.1), 0.9, (8.0, 6.0, 4.0))
LIGHTS = (BOX.lights, (MOVED, gi.Environment((0.2, 0.3, 0.4))))

SMALL: dict[str, Any] = {"bounces": 0, "shadow_size": 32, "rsm_size": 32}
BOUNCES = (None, "multires", "vpl", "gather", "ssdo")


class Stop(BaseException):
    """Stand-in for the exception of Ctrl-C."""


@pytest.fixture
def stopper(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[int], None]]:
    """Make the device raise at a step from now: before the n-th thing it is told, or after."""
    left = [-1]

    def around(run: Callable[..., Any]) -> Callable[..., Any]:
        def count() -> None:
            left[0] -= 1
            if left[0] == -1:
                raise Stop

        def stopping(*args: Any, **kwargs: Any) -> Any:
            count()
            result = run(*args, **kwargs)
            count()
            return result

        return stopping

    for of, names in ((Kernel, ["run"]), (Plane, ["upload", "copy_image"]), (DeviceArray, ["upload", "send"])):
        for name in names:
            monkeypatch.setattr(of, name, around(getattr(of, name)))

    def stop(step: int) -> None:
        left[0] = step

    yield stop
    left[0] = -1


def renderer(runtime: Runtime, bounce: str | None, skips: bool) -> Renderer:
    cameras = {"layers": 2, "auxiliary_cameras": 2} if bounce == "ssdo" else {}
    return Renderer(
        runtime,
        CAMERAS[0].size,
        FrameParams(
            ao=GtaoParams(radius=0.3), ao_radius=0.5, indirect=bounce, vpls=64, skips=skips, **SMALL, **cameras
        ),
    )


@pytest.mark.parametrize("skips", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("bounce", "every"), [(None, 5), ("gather", 9), *(pytest.param(b, 3, marks=pytest.mark.slow) for b in BOUNCES)]
)
def test_a_renderer_is_right_after_it_was_stopped_at_any_step(
    runtime: Runtime, stopper: Callable[[int], None], bounce: str | None, every: int, skips: bool
) -> None:
    """Steps an odd number apart: before and after take turns."""
    kept = renderer(runtime, bounce, skips)
    views = [(camera, lights) for camera in CAMERAS for lights in LIGHTS]
    expected = [kept(BOX.scene, *view).radiance for view in views]
    stopped = step = 0
    while True:
        # Another view than the last one seen, so that all stages run.
        stopper(step)
        try:
            kept(BOX.scene, *views[stopped % 4])
        except Stop:
            stopped += 1
        else:
            break
        for view in (stopped % 4, (stopped + 2) % 4):  # the next lights, then by another camera
            np.testing.assert_array_equal(
                kept(BOX.scene, *views[view]).radiance, expected[view], err_msg=f"stopped at step {step}"
            )
        step += every
    stopper(-1)
    assert stopped > 3, "a frame has ten passes at the least"


@pytest.mark.parametrize(
    "name", ["gtao", *(pytest.param(n, marks=pytest.mark.slow) for n in ("multires_splat", "ssdo"))]
)
def test_functions_are_right_after_they_were_stopped(
    runtime: Runtime, stopper: Callable[[int], None], name: str
) -> None:
    gbuffers = [gi.rasterize.gbuffer(BOX.scene, camera, runtime=runtime) for camera in CAMERAS]
    rsm = gi.rasterize.rsm(BOX.scene, MOVED, size=32, runtime=runtime)
    calls: dict[str, Callable[[Any], Any]] = {
        "gtao": lambda g: gi.gtao(g, radius=0.3, runtime=runtime),
        "multires_splat": lambda g: gi.multires_splat(g, rsm, vpls=64, runtime=runtime),
        "ssdo": lambda g: gi.ssdo(g, lights=[MOVED], radius=0.5, runtime=runtime)[0],
    }
    call = calls[name]
    expected = [call(g) for g in gbuffers]
    step, stopped = 0, True
    while stopped:
        stopper(step)
        try:
            call(gbuffers[0])
            stopped = False
        except Stop:
            step += 7
        stopper(-1)
        for found, right in zip(map(call, reversed(gbuffers)), reversed(expected), strict=True):
            np.testing.assert_array_equal(found, right)
    assert step > 7


def test_an_error_in_arguments_costs_nothing_that_is_kept(runtime: Runtime) -> None:
    gbuffer = gi.rasterize.gbuffer(BOX.scene, CAMERAS[0], runtime=runtime)
    gi.gtao(gbuffer, radius=0.3, runtime=runtime)
    before = runtime.allocated_bytes
    with pytest.raises(ValueError, match="radius is -1"):
        gi.gtao(gbuffer, radius=-1, runtime=runtime)
    gi.gtao(gbuffer, radius=0.3, runtime=runtime)
    assert runtime.allocated_bytes == before


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_five_hundred_real_interrupts(runtime: Runtime) -> None:
    """By a timer at random times of a frame, through the public functions."""
    rng = np.random.default_rng(3)
    modes: list[dict[str, Any]] = [
        {"indirect": "multires", "vpls": 64},
        {"indirect": "ssdo", "auxiliary_cameras": 2},
        {"ao": "ssao"},
        {"indirect": "gather", "skips": False},
    ]

    def shot(mode: int, camera: int, lights: int) -> Any:
        given = {**SMALL, **modes[mode]}
        return gi.render(BOX.scene, CAMERAS[camera], LIGHTS[lights], runtime=runtime, **given).radiance

    def raise_interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    cases = [(m, c, lit) for m in range(len(modes)) for c in range(2) for lit in range(2)]
    expected = {case: shot(*case) for case in cases}
    before = signal.signal(signal.SIGALRM, raise_interrupt)
    hit = 0
    try:
        while hit < 500:
            case = cases[rng.integers(len(cases))]
            try:
                signal.setitimer(signal.ITIMER_REAL, rng.uniform(1e-5, 0.02))
                try:
                    shot(*case)
                finally:
                    signal.setitimer(signal.ITIMER_REAL, 0.0)
            except KeyboardInterrupt:
                hit += 1
            for other in (case, cases[rng.integers(len(cases))]):
                np.testing.assert_array_equal(shot(*other), expected[other])
    finally:
        signal.signal(signal.SIGALRM, before)
