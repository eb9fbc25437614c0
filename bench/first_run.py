"""The report of a first run on a device: agreement with stored results, kernels' times beside predicted ones."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from itertools import count
from statistics import median
from typing import Any

import numpy as np

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import SsgiError
from ssgi_cl.device import drivers
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.timing import PassTime
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.tuning.calibration import Calibration

from . import document
from .counted_work import Ceilings, counted, predicted_ms
from .self_test import Outcome, self_test
from .wording import NOTHING, markdown

FORMAT = "ssgi-first-run 1"
SCENE, FRAMES = "cornell_box", 5
AGREEMENT_SECONDS = 300.0
"""Of each kernel variant; nearly all of it goes into compiling."""


@dataclass(frozen=True)
class Timed:
    """A kernel of a frame.

    Attributes:
        name: of the kernel, or of copies.
        launches: of a frame.
        ms: measured, of all launches of a frame, median of some frames.
        predicted: milliseconds by counted work and the device's ceilings; None where no work is counted.
    """

    name: str
    launches: int
    ms: float
    predicted: float | None


def timed(frames: list[list[PassTime]], ceilings: Ceilings) -> list[Timed]:
    """Return the kernels of some frames alike, those that take longest first."""
    work = counted()
    whole: dict[str, list[float]] = defaultdict(lambda: [0.0] * len(frames))
    launches: dict[str, list[int]] = defaultdict(list)
    for number, passes in enumerate(frames):
        for each in passes:
            if each.skipped:
                continue
            whole[each.name][number] += each.ms
            if number == 0:
                launches[each.name].append(each.items)
    found = []
    for name, items in launches.items():
        known = name in work and all(items)
        predicted = sum(predicted_ms(work[name], count, ceilings) for count in items) if known else None
        found.append(Timed(name, len(items), median(whole[name]), predicted))
    return sorted(found, key=lambda each: -each.ms)


def first_run(runtime: Runtime, size: Size, step: Callable[[str, float], object]) -> dict[str, Any]:
    """Measure and return a document.

    Args:
        runtime: the device and the form that are timed; agreement is of all forms that run.
        size: (rows, columns) of the frames.
        step: is told what is under way, and the share that is done.
    """
    info = runtime.info
    agreement: dict[str, list[Outcome]] = {}
    for variant in drivers.KERNEL_VARIANTS:
        if isinstance(info.speeds.get(str(variant)), float):
            told = f"agreement, {variant}"
            agreement[str(variant)] = self_test(
                info,
                variant,
                AGREEMENT_SECONDS,
                lambda name, share, told=told: step(f"{told}: {name}", share),  # type: ignore[misc]
            )
    step("ceilings", 0.0)
    measured = Calibration.of(runtime)
    ceilings = Ceilings(measured.multiply_adds_gflop_s, measured.bandwidth_gb_s)
    return {
        **document.stamp(runtime),
        "format": FORMAT,
        "facts": info.facts,
        "speeds": info.speeds,
        "ceilings": asdict(measured),
        "scene": SCENE,
        "size": list(size),
        "agreement": {
            variant: [{"technique": each.technique, "good": each.good, "result": str(each)} for each in outcomes]
            for variant, outcomes in agreement.items()
        },
        "techniques": {
            name: [asdict(each) for each in timed(frames, ceilings)] for name, frames in _frames(runtime, size, step)
        },
    }


def _frames(
    runtime: Runtime, size: Size, step: Callable[[str, float], object]
) -> list[tuple[str, list[list[PassTime]]]]:
    """Return the passes of some calls of the whole frame and of techniques with their defaults, after a first one."""
    made = make_scene(SCENE)
    camera = made.camera(size[1], size[0])
    gbuffer = gi.rasterize.gbuffer(made.scene, camera, runtime=runtime)
    spot = next(light for light in made.lights if isinstance(light, gi.SpotLight))
    rsm = gi.rasterize.rsm(made.scene, spot, size=256, runtime=runtime)
    cameras = _moving(camera)  # a picture of the same view is kept, and takes nothing
    calls: dict[str, Callable[[], object]] = {
        "render": lambda: gi.render(made.scene, next(cameras), made.lights, runtime=runtime),
        "gtao": lambda: gi.gtao(gbuffer, radius=0.3, runtime=runtime),
        "hbao": lambda: gi.hbao(gbuffer, radius=0.3, runtime=runtime),
        "bitmask_ao": lambda: gi.bitmask_ao(gbuffer, radius=0.3, runtime=runtime),
        "ssao": lambda: gi.ssao(gbuffer, radius=0.3, runtime=runtime),
        "rsm_gather": lambda: gi.rsm_gather(gbuffer, rsm, runtime=runtime),
        "ssdo": lambda: gi.ssdo(gbuffer, made.lights, radius=0.3, runtime=runtime),
    }
    found = []
    for number, (name, call) in enumerate(calls.items()):
        step(f"times of {name}", number / len(calls))
        frames = []
        try:
            for repeat in range(1 + FRAMES):
                with runtime.frame():
                    call()
                    passes = runtime.times()
                if repeat:
                    frames.append(passes)
        except SsgiError:
            continue  # the self-test has its error
        found.append((name, frames))
    return found


def _moving(camera: Camera) -> Iterator[Camera]:
    """Yield views that each lie a little to the right of the one before."""
    for number in count(1):
        view = np.array(camera.view)
        view[0, 3] -= 1e-3 * number
        yield replace(camera, view=view)


def failing(found: dict[str, Any]) -> bool:
    """Return whether any technique differs beyond the tolerance in any form."""
    return not all(each["good"] for outcomes in found["agreement"].values() for each in outcomes)


def page(found: dict[str, Any]) -> str:
    """Return the report as Markdown."""
    device, ceilings = found["device"], found["ceilings"]
    rows, columns = found["size"]
    lines = [
        f"# {device['label']}",
        "",
        f"{device['variant']}; {found['facts'].get('opencl', '')}; ssgi-cl {found['versions']['ssgi_cl']}, revision "
        f"{found['revision']}; {found['machine']['system']}.",
        "",
        f"Measured: {ceilings['bandwidth_gb_s']:.4g} GB/s, {ceilings['multiply_adds_gflop_s']:.4g} Gflop/s, "
        f"{ceilings['gathers_g_s']:.3g} billion scattered reads a second.",
        "",
        "## Agreement with stored results",
        "",
    ]
    for variant, outcomes in found["agreement"].items():
        same = sum(each["result"] == "same bits" for each in outcomes)
        lines.append(f"- {variant}: {same} of {len(outcomes)} techniques have the same bits")
        lines += [f"  - {each['technique']}: {each['result']}" for each in outcomes if each["result"] != "same bits"]
    lines += ["", f"## Times of kernels, {found['scene']}, {columns} x {rows}", ""]
    lines.append(
        "Predicted is the longest of counted operations over the measured rate, counted bytes over the measured "
        "bandwidth, and a launch of 5 us; no operation is left out by a compiler and no read hits a cache."
    )
    head = ("kernel", "launches", "ms", "predicted", "measured over predicted")
    for name, kernels in found["techniques"].items():
        cells = []
        for each in kernels:
            known = each["predicted"] is not None
            predicted = f"{each['predicted']:.4f}" if known else NOTHING
            ratio = f"{each['ms'] / each['predicted']:.2f}" if known else NOTHING
            cells.append((each["name"], str(each["launches"]), f"{each['ms']:.4f}", predicted, ratio))
        lines += ["", f"### {name}", "", *markdown(head, cells, "lrrrr")]
    return "\n".join(lines) + "\n"
