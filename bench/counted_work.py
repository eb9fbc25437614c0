"""Work of kernels, counted in a simulator, and the times that follow from it.

`oclgrind --inst-counts python -m ssgi_cl.bench.counted_work FILE > LOG` draws small frames with default settings and
notes the launches (with --build-options as in tests/stress/test_memory.py), `python -m ssgi_cl.bench.counted_work FILE
--log LOG` makes `counted_work.json` of both; of a log that ends early, what it has, and kernels that it lacks keep what
they had. What is counted is a work-item's: that of image kernels does not grow with the image.

`--rays FOLDER` draws frames with rays against triangles in place of the others. An hour does not suffice to
simulate them in full: the first run, without the simulator, keeps in FOLDER what kernels write on the device;
the second, in the simulator, runs some work-groups of each (`FEW`) and goes on with what is kept; a third makes
the record.
"""

from __future__ import annotations

import json
import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from itertools import count
from math import prod
from pathlib import Path
from typing import Any

import click
import numpy as np

import ssgi_cl as gi
from ssgi_cl.core.atomic import replacement
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.constants import REFLECT_SMOOTH
from ssgi_cl.device.drivers import DeviceInfo, KernelVariant
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.opencl import opencl
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.techniques.multires import final_gather
from ssgi_cl.techniques.vpl import vpl_splat

from .drawn import polished

RECORD = Path(__file__).with_name("counted_work.json")
PAGE = Path(__file__).parents[1] / "docs/gpu.md"
SIZE = (36, 48)
"""(rows, columns) of the images; a simulator takes some microseconds for each instruction."""
TEXELS = 64
"""Along a side of the lights' maps."""
LIGHTS = 256
"""Virtual point lights."""
RAY_SIZE, RAY_TEXELS, RAY_LIGHTS = (12, 16), 16, 64
"""Likewise with `--rays`."""
ALL = 1 << 30
"""Work-groups."""
WITH_RAYS = {
    "sky_probe": 1, "sky_rays": 3, "radiosity_start": 3, "radiosity_sky": 3, "radiosity_rays": 3,
    "radiosity_bounce": 3, "radiosity_escape": 3, "radiosity_met": 3, "radiosity_blocked": 3, "radiosity_places": 3,
    "radiosity_lend": 3, "radiosity_reached": 3, "radiosity_divide": 3,
    "radiosity_emission": 3, "radiosity_direct": 3, "final_gather": ALL, "shade_list": ALL, "reflect_mirror": ALL,
}  # fmt: skip
"""Kernel that `--rays` counts -> work-groups of a launch that the simulator runs, spread evenly."""
FEW = {
    **WITH_RAYS,
    "occupancy_voxelize": 1, "occupancy_reach": 1, "occupancy_clear": 1, "raster_fill": 4, "raster_tiles": 2,
    "sky_openness": 3, "sampled_depth": 0, "vpl_partial_sums": 1, "vpl_place": 3, "vpl_to_view": 3, "gtao": 3,
}  # fmt: skip
"""Likewise of kernels that are counted if they are not yet, as are others, which are run in full. In
`sampled_depth` one work-group has all texels of its views, for which minutes do not suffice."""
_ARITHMETIC = re.compile(
    r"f?(?:add|sub|mul|neg|cmp)|[fsu]div|[fsu]rem|icmp|and|or|xor|shl|[al]shr|select|[su]itofp|fpto[su]i|call _Z.*"
)
"""Instructions of LLVM that compute; calls of built-in functions count once."""
_TWICE = re.compile(r"call _Z3(?:fma|mad)")
_LINE = re.compile(r"\s*([\d,]+) - (.*?)(?: \((\d+) bytes\))?$")


@dataclass(frozen=True)
class Work:
    """What a work-item does on average.

    Attributes:
        operations: arithmetic ones, of numbers and of places, as the source has them: compilers leave some out.
        reads: of global and constant memory.
        bytes: read from global memory and written to it, caches or not.
    """

    operations: float
    reads: float
    bytes: float


@dataclass(frozen=True)
class Ceilings:
    """What a device can do at most.

    Attributes:
        gflop_s: operations, 1e9 a second.
        gb_s: of memory, 1e9 bytes a second.
        launch_us: microseconds that a launch takes at least.
    """

    gflop_s: float
    gb_s: float
    launch_us: float = 5.0


SLOW_GPU = Ceilings(1000.0, 50.0)
"""Of the slowest that is looked after: 1 TFLOP/s, memory that it shares with a processor."""
GPUS = {
    "1 TFLOP/s, 50 GB/s": SLOW_GPU,
    "RTX 3060": Ceilings(12740.0, 360.0),
    "RX 6800": Ceilings(16170.0, 512.0),
    "Arc A770": Ceilings(19660.0, 560.0),
}
"""Name -> ceilings as their makers state them."""
PIXELS = 3840 * 2160
OF_PARTS = (
    "blocked", "bounce", "direct", "divide", "emission", "escape", "lend", "met", "places", "rays", "reached",
)  # fmt: skip
"""Kernels of radiosity that have a work-item for each part of a surfel, or fewer."""
GATHER_RAYS = 1.6
"""Rays of a work-item of final_gather, the mean of those that `--rays` counts: many have no point in small
images."""
ITEMS = {f"radiosity_{name}": 1 << 19 for name in OF_PARTS} | {
    "radiosity_start": 1 << 15,
    "radiosity_sky": 1 << 15,
    "occupancy_voxelize": 1 << 16,
    "bvh_split": 1 << 17,
    "sky_openness": 1 << 16,
    "final_gather": int(final_gather.RAYS_AT_ONCE / GATHER_RAYS),
    "vpl_splat": PIXELS // vpl_splat.ROWS,
}
"""Work-items of a launch of kernels, for predictions, at most; those of others are `PIXELS`. Launches of
final_gather are split."""


def predicted_ms(work: Work, items: int, ceilings: Ceilings) -> float:
    """Return the milliseconds of a launch with so many work-items: the longest of computing, memory and launching."""
    computing = work.operations * items / ceilings.gflop_s
    moving = work.bytes * items / ceilings.gb_s
    return max(1e-6 * max(computing, moving), 1e-3 * ceilings.launch_us)


@cache
def counted() -> Mapping[str, Work]:
    """Return the recorded work of a work-item of each kernel."""
    return {name: Work(**numbers) for name, numbers in json.loads(RECORD.read_text(encoding="utf-8")).items()}


def markdown() -> str:
    """Return the table of docs/gpu.md: what is counted, and times of a launch of a work-item for each pixel of 4K."""
    lines = [
        "| kernel | operations | reads | bytes | " + " | ".join(f"{name}, ms" for name in GPUS) + " |",
        "|---|" + "---:|" * (3 + len(GPUS)),
    ]
    for name, work in sorted(counted().items(), key=lambda item: -item[1].operations):
        times = (f"{predicted_ms(work, ITEMS.get(name, PIXELS), ceilings):.2f}" for ceilings in GPUS.values())
        numbers = f"{work.operations:.0f} | {work.reads:.1f} | {work.bytes:.0f}"
        lines.append(f"| {name} | {numbers} | {' | '.join(times)} |")
    return "\n".join(lines) + "\n"


def parsed(lines: Iterable[str]) -> Iterator[tuple[str, Work]]:
    """Yield the kernel and the work of all of its work-items, launch by launch, of a log of `--inst-counts`."""
    name = ""
    numbers = [0, 0, 0]
    for line in lines:
        if found := re.match(r"Instructions executed for kernel '(\w+)'", line):
            if name:
                yield name, Work(*numbers)
            name, numbers = found[1], [0, 0, 0]
        elif name and (found := _LINE.match(line.rstrip())):
            count, what = int(found[1].replace(",", "")), found[2]
            if _ARITHMETIC.fullmatch(what):
                numbers[0] += count * (2 if _TWICE.match(what) else 1)
            elif what.startswith(("load global", "load constant", "store global")):
                numbers[1] += count if what.startswith("load") else 0
                numbers[2] += int(found[3] or 0) if "global" in what else 0
    if name:
        yield name, Work(*numbers)


def per_item(launches: Iterable[tuple[str, int, float]], log: Iterable[str]) -> dict[str, Work]:
    """Return the mean work of a work-item of each kernel.

    Args:
        launches: kernel, number of work-items, and for how many launches like it this one stands (0: it does
            not count), in order.
        log: lines of the simulator, of the same launches or of the first of them.
    """
    sums: dict[str, list[float]] = defaultdict(lambda: [0.0] * 4)
    for (name, items, stands), (logged, work) in zip(launches, parsed(log), strict=False):
        if name != logged:
            raise ValueError(f"the log has a launch of {logged}: expected {name}, as was noted")
        for place, number in enumerate((work.operations, work.reads, work.bytes, items)):
            sums[name][place] += stands * number
    counting = sorted((name, total) for name, total in sums.items() if total[3])
    return {name: Work(*(round(each / total[3], 2) for each in total[:3])) for name, total in counting}


def _spread(work: Sequence[int], local: Sequence[int], few: int) -> Iterator[tuple[int, int]]:
    """Yield the first work-items of some work-groups of a launch, spread evenly."""
    columns, rows = (count // own for count, own in zip(work, local, strict=True))
    for number in range(few):
        group = (2 * number + 1) * columns * rows // (2 * few)
        yield group % columns * local[0], group // columns * local[1]


def _draw(path: Path, kept: Path | None) -> None:
    """Draw frames and call techniques on the first device, and note the launches.

    With a folder the frames are those with rays, and it keeps or gives what kernels write.
    """
    cl = opencl()
    noted: list[tuple[str, int, float]] = []
    launch = cl.enqueue_nd_range_kernel

    def note(queue: Any, kernel: Any, work: Sequence[int], *rest: Any, stands: float = 1.0) -> Any:
        noted.append((kernel.function_name, prod(work), stands))
        path.write_text(json.dumps(noted), encoding="utf-8")
        return launch(queue, kernel, work, *rest)

    def noting(queue: Any, kernel: Any, work: Sequence[int], local: Sequence[int], *rest: Any) -> Any:
        few = FEW.get(kernel.function_name, ALL) if simulated else ALL
        if few == 0:
            return cl.enqueue_marker(queue)
        if prod(work) <= few * prod(local):
            return note(queue, kernel, work, local, *rest)
        stands = prod(work) / (few * prod(local))
        return [note(queue, kernel, local, local, first, stands=stands) for first in _spread(work, local, few)][-1]

    cl.enqueue_nd_range_kernel = noting
    final_gather.MOST_DEALT = 0  # a work-item has all rays of a point, as in large images
    runtime = Runtime(DeviceInfo("", 0, 0, "the first device", "gpu", 1), KernelVariant(1, "buffer"))
    simulated = kept is not None and kept.exists()
    if kept is not None:
        _keep_results(kept)
        _draw_rays(runtime)
        return
    made = make_scene("cornell_box")
    rows, columns = SIZE
    camera = made.camera(columns, rows)
    sizes: dict[str, Any] = {"shadow_size": TEXELS, "rsm_size": TEXELS, "runtime": runtime}
    gi.render(made.scene, camera, made.lights, bounces=0, ao="gtao", edges=0, **sizes)
    gbuffer = gi.rasterize.gbuffer(made.scene, camera, runtime=runtime)
    for technique in (gi.gtao, gi.hbao, gi.bitmask_ao, gi.ssao):
        technique(gbuffer, radius=0.3, runtime=runtime)
    spot = next(light for light in made.lights if isinstance(light, gi.SpotLight))
    rsm = gi.rasterize.rsm(made.scene, spot, size=TEXELS, runtime=runtime)
    gi.rsm_gather(gbuffer, rsm, runtime=runtime)
    gi.ssdo(gbuffer, made.lights, radius=0.3, runtime=runtime)
    gi.bilateral_blur(np.asarray(gbuffer.albedo), gbuffer, runtime=runtime)
    gi.area_lights(gbuffer, scene=made.scene, runtime=runtime)
    gi.multires_splat(gbuffer, rsm, LIGHTS, runtime=runtime)


def _draw_rays(runtime: Runtime) -> None:
    """Draw frames of all light, with rays against triangles, and of what is reflected, below a sky."""
    made = make_scene("cornell_box")
    camera = made.camera(RAY_SIZE[1], RAY_SIZE[0])
    gbuffer = gi.rasterize.gbuffer(made.scene, camera, runtime=runtime)
    spot = next(light for light in made.lights if isinstance(light, gi.SpotLight))
    rsm = gi.rasterize.rsm(made.scene, spot, size=RAY_TEXELS, runtime=runtime)
    gi.sky_rays(gbuffer, [gi.Environment(1.0)], scene=made.scene, runtime=runtime)
    gi.vpl_splat(gbuffer, rsm, LIGHTS, runtime=runtime)
    gi.multires_splat(gbuffer, rsm, RAY_LIGHTS, visibility=True, scene=made.scene, runtime=runtime)
    sizes: dict[str, Any] = {"vpls": RAY_LIGHTS, "shadow_size": RAY_TEXELS, "rsm_size": RAY_TEXELS, "runtime": runtime}
    gi.render(made.scene, camera, made.lights, edges=0, **sizes)
    sky, glossy = [gi.Environment(1.0)], polished(made.scene)
    gi.render(glossy, camera, [*made.lights, *sky], preset="low", edges=0, **sizes)
    smooth = replace(glossy, materials=tuple(replace(each, gloss=REFLECT_SMOOTH) for each in glossy.materials))
    gbuffer = gi.rasterize.gbuffer(smooth, camera, attributes="all", runtime=runtime)
    few = gi.RadiosityParams(surfels=64, bounces=1)
    gi.reflections(gbuffer, np.ones((*RAY_SIZE, 3), np.float32), sky, scene=smooth, radiosity=few, runtime=runtime)


def _keep_results(folder: Path) -> None:
    """Keep what kernels write from now on in a folder; if it is there already, they write what it has."""
    given = folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    numbers = count()
    run = Kernel.run

    def running(kernel: Kernel, size: Size, /, **arguments: Any) -> None:
        run(kernel, size, **arguments)
        cl, queue = opencl(), kernel.runtime.queue
        written = (each.name for each in kernel.signature.parameters if each.written)
        buffers = {name: arguments[name].buffer for name in written if arguments[name] is not None}
        file = folder / f"{next(numbers)}_{kernel.name}.npz"
        if not given:
            results = {name: np.empty(buffer.size, np.uint8) for name, buffer in buffers.items()}
            for name, buffer in buffers.items():
                cl.enqueue_copy(queue, results[name], buffer)
            np.savez(file, **results)  # type: ignore[arg-type]  # numpy's own names are not a kernel's
            return
        kept = np.load(file)
        for name, buffer in buffers.items():
            if kept[name].nbytes != buffer.size:
                raise ValueError(f"{file} has {kept[name].nbytes} bytes of {name}: expected {buffer.size}")
            cl.enqueue_copy(queue, buffer, kept[name])

    Kernel.run = running  # type: ignore[method-assign]


def _write_page() -> None:
    block = re.compile(r"(<!-- work -->\n).*?(<!-- end -->)", re.DOTALL)
    counted.cache_clear()
    page = block.sub(lambda match: match[1] + markdown() + match[2], PAGE.read_text(encoding="utf-8"))
    with replacement(PAGE) as file:
        file.write_text(page, encoding="utf-8")


@click.command()
@click.argument("launches", type=click.Path(path_type=Path))
@click.option("--log", type=click.Path(path_type=Path, exists=True), help="Make the record of this log.")
@click.option("--rays", type=click.Path(path_type=Path), help="Count rays against triangles, with results kept here.")
def main(launches: Path, log: Path | None, rays: Path | None) -> None:
    """Note LAUNCHES, a JSON file, while a simulator counts; or record what it has counted."""
    if log is None:
        _draw(launches, rays)
        return
    with log.open(encoding="utf-8", errors="replace") as lines:
        found = per_item(json.loads(launches.read_text(encoding="utf-8")), lines)
    kept = {name: work for name, work in counted().items() if not rays or name not in WITH_RAYS or name not in found}
    found = {**found, **kept} if rays else {**kept, **found}
    entries = ",\n".join(f' "{name}": {json.dumps(asdict(work))}' for name, work in sorted(found.items()))
    with replacement(RECORD) as file:
        file.write_text(f"{{\n{entries}\n}}\n", encoding="utf-8")
    _write_page()


if __name__ == "__main__":
    main(prog_name="python -m ssgi_cl.bench.counted_work")
