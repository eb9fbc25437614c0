"""One device shared by threads, interrupted at random times, and forked."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from random import Random
from typing import Any

import numpy as np

import ssgi_cl as gi
from ssgi_cl.core.errors import DeviceError
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES

CALLS = 10_000
FRAMES = 400
THREADS = 8
INTERRUPTS = 500
FORKS = 10

MODES: tuple[dict[str, Any], ...] = (
    {"indirect": "multires", "vpls": 64},
    {"indirect": "vpl", "vpls": 64},
    {"indirect": "gather", "skips": False},
    {"indirect": "ssdo", "layers": 2, "auxiliary_cameras": 2},
    {"ao": "ssao"},
    {"ao": "bitmask_ao", "layers": 2},
)


def _frames() -> tuple[list[tuple[int, int, int]], Callable[[tuple[int, int, int]], Any]]:
    """Return what tells frames apart, and what renders one: mode, camera, lights."""
    box = BUILTIN_SCENES["cornell_box"]()
    cameras = [gi.Camera.look_at((x, 1.0, 3.4), (0, 1, 0), width=64, height=48) for x in (-0.2, 0.3)]
    moved = gi.SpotLight((0.3, 1.9, 0.2), (0.0, -1.0, 0.1), 0.9, (8.0, 6.0, 4.0))
    lights = (box.lights, (moved, gi.Environment((0.2, 0.3, 0.4))))

    def frame(which: tuple[int, int, int]) -> Any:
        mode, camera, lit = which
        return gi.render(
            box.scene, cameras[camera], lights[lit], bounces=0, shadow_size=64, rsm_size=64, **MODES[mode]
        ).radiance

    return [(m, c, lit) for m in range(len(MODES)) for c in (0, 1) for lit in (0, 1)], frame


def _equal(found: Any, right: Any, where: object) -> None:
    np.testing.assert_array_equal(found, right, err_msg=str(where))


def threads(seed: int) -> None:
    """Calls from many threads give what they give one after the other."""
    box = BUILTIN_SCENES["cornell_box"]()
    gbuffers = [
        gi.rasterize.gbuffer(box.scene, gi.Camera.look_at((0.1 * i, 1, 3.4), (0, 1, 0), width=64, height=48))
        for i in range(THREADS)
    ]
    calls: list[Callable[[Any], Any]] = [
        lambda g: gi.gtao(g, radius=0.3),
        lambda g: gi.ssao(g, radius=0.3),
        lambda g: gi.hbao(g, radius=0.3),
    ]
    expected = [[call(g) for g in gbuffers] for call in calls]
    rng = Random(seed)
    order = [(rng.randrange(len(calls)), rng.randrange(THREADS)) for _ in range(CALLS)]
    with ThreadPoolExecutor(THREADS) as pool:
        found = pool.map(lambda at: calls[at[0]](gbuffers[at[1]]), order)
        for (call, gbuffer), result in zip(order, found, strict=True):
            _equal(result, expected[call][gbuffer], (call, gbuffer))


def threads_rendering(seed: int) -> None:
    """Frames of all kinds from many threads."""
    cases, frame = _frames()
    expected = {case: frame(case) for case in cases}
    order = Random(seed).choices(cases, k=FRAMES)
    with ThreadPoolExecutor(THREADS) as pool:
        for case, found in zip(order, pool.map(frame, order), strict=True):
            _equal(found, expected[case], case)


def interrupts(seed: int) -> None:
    """Ctrl-C at random times of a frame; later frames are as they were."""
    cases, frame = _frames()
    expected, rng, hit = {}, Random(seed), 0
    times = {}
    for case in cases:
        frame(case)
        start = time.perf_counter()
        expected[case] = frame(case)
        times[case] = time.perf_counter() - start

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGALRM, stop)
    while hit < INTERRUPTS:
        case = rng.choice(cases)
        try:
            signal.setitimer(signal.ITIMER_REAL, max(1e-5, rng.random() * times[case]))
            try:
                frame(case)
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
        except KeyboardInterrupt:
            hit += 1
        same_lights = rng.choice([c for c in cases if c[0] == case[0] and c[2] == case[2]])
        for other in (same_lights, rng.choice(cases)):
            _equal(frame(other), expected[other], (case, other, hit))


def forks(seed: int) -> None:
    """Forked processes are told at once; the parent goes on."""
    cases, frame = _frames()
    case = Random(seed).choice(cases)
    expected = frame(case)
    for _ in range(FORKS):
        child = os.fork()
        if child == 0:
            try:
                frame(case)
            except DeviceError as error:
                os._exit(0 if "forked" in str(error) else 2)
            os._exit(1)
        end = time.monotonic() + 5.0
        done, status = 0, 0
        while not done and time.monotonic() < end:
            done, status = os.waitpid(child, os.WNOHANG)
            time.sleep(0.01)
        if not done:
            os.kill(child, signal.SIGKILL)
            raise AssertionError("a forked process hangs")
        if status:
            raise AssertionError(f"a forked process ends with status {status}")
        _equal(frame(case), expected, case)


CASES: dict[str, Callable[[int], None]] = {
    "threads": threads,
    "threads_rendering": threads_rendering,
    "interrupts": interrupts,
    "forks": forks,
}
