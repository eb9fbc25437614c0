"""Time the passes, and hold SSAO to ray casting: `python -m ssgi_cl.bench --help`."""

from __future__ import annotations

import json
import statistics
from collections.abc import Callable
from typing import Any

import click
import numpy as np
from rich.console import Console
from rich.table import Table

import ssgi_cl as gi
from ssgi_cl.device_gbuffer import DeviceGBuffer
from ssgi_cl.rasterize.device_scene import DeviceScene
from ssgi_cl.rasterize.rasterizer import Rasterizer
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, BuiltinScene
from ssgi_cl.runtime import Runtime
from ssgi_cl.techniques.bilateral import Bilateral, BilateralParams
from ssgi_cl.techniques.ssao import Ssao, SsaoParams
from ssgi_cl.techniques.upsample import ReducedGBuffer, Upsample

SIZE = (600, 800)
WARM_UP, REPEATS = 3, 15


def median_ms(runtime: Runtime, run: Callable[[], Any]) -> float:
    """Return the median device time of a frame in milliseconds."""
    samples = []
    for index in range(WARM_UP + REPEATS):
        with runtime.frame():
            run()
            total = sum(p.ms for p in runtime.times())
        if index >= WARM_UP:
            samples.append(total)
    return statistics.median(samples)


def measure(runtime: Runtime, scene: Any, camera: gi.Camera, radius: float) -> dict[str, float]:
    """Return case -> milliseconds on the device."""
    kept = DeviceScene(runtime, scene)
    rasterizer = Rasterizer(runtime, SIZE)
    shadow = Rasterizer(runtime, (512, 512), shaded=False)
    results = {
        "gbuffer": median_ms(runtime, lambda: rasterizer.render(kept, camera)),
        "rsm depth 512": median_ms(
            runtime, lambda: shadow.render(kept, _resized(camera, 512, 512))
        ),
    }
    gbuffer: DeviceGBuffer = rasterizer.target
    results["view normals"] = median_ms(runtime, gbuffer.derive)
    ssao = Ssao(runtime, SIZE, SsaoParams(radius=(radius,), samples=16, blur_radius=0))
    results["ssao 16"] = median_ms(runtime, lambda: ssao.run(gbuffer))
    plane = ssao.run(gbuffer)
    blur = Bilateral(runtime, SIZE, BilateralParams(radius=7))
    results["blur 7"] = median_ms(runtime, lambda: blur.run(plane, gbuffer))
    reduced = ReducedGBuffer(gbuffer, 2)
    with runtime.frame():
        reduced.update(gbuffer)
    half = runtime.plane(1, reduced.size, 1.0)
    upsample = Upsample(runtime, SIZE, 2)
    results["upsample 2"] = median_ms(runtime, lambda: upsample.run(half, reduced, gbuffer))
    return results


def ssao_errors(runtime: Runtime, builtin: BuiltinScene) -> dict[str, dict[str, float]]:
    """Return attenuation -> errors of SSAO with 16 samples against 128 rays a pixel, at 400 x 300.

    `constant` is the RMSE of the best constant image, which any technique should beat.
    """
    camera = builtin.camera(400, 300)
    gbuffer = gi.rasterize.gbuffer(builtin.scene, camera, runtime=runtime)
    seen = np.isfinite(np.asarray(gbuffer.depth))
    image = gi.ssao(gbuffer, builtin.ao_radius, 16, runtime=runtime)
    errors = {}
    for attenuation in ("none", "linear"):
        truth = gi.ray_ao(
            builtin.scene, camera, builtin.ao_radius, 128, attenuation=attenuation
        )
        errors[attenuation] = {
            "rmse": gi.metrics.rmse(image, truth, seen),
            "bias": gi.metrics.bias(image, truth, seen),
            "constant": float(truth[seen].std()),
        }
    return errors


def _resized(camera: gi.Camera, width: int, height: int) -> gi.Camera:
    return gi.Camera(
        view=camera.view, projection=camera.projection, width=width, height=height,
        depth_range=camera.depth_range,
    )


@click.command()
@click.option("--device", help="Words of the device's label; by default the fastest found.")
@click.option("--scene", default="hall", show_default=True, help="Built-in scene.")
@click.option("--lanes", type=int, help="Force 1, 8 or 16 lanes.")
@click.option("--storage", type=click.Choice(["buffer", "image"]), help="Force what kernels read.")
@click.option("--error", is_flag=True, help="SSAO's error against ray casting too (extra `truth`).")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def main(
    device: str | None, scene: str, lanes: int | None, storage: str | None, error: bool,
    as_json: bool,
) -> None:
    """Time the passes at 800 x 600: medians of device time."""
    if scene not in BUILTIN_SCENES:
        raise click.UsageError(f"--scene is {scene!r}: expected one of {', '.join(BUILTIN_SCENES)}")
    runtime = Runtime.open(device, lanes=lanes, storage=storage)
    builtin = BUILTIN_SCENES[scene]()
    camera = builtin.camera(SIZE[1], SIZE[0])
    results = measure(runtime, builtin.scene, camera, builtin.ao_radius)
    errors = ssao_errors(runtime, builtin) if error else {}
    if as_json:
        print(json.dumps({"device": runtime.info.label, "form": str(runtime.form), "ms": results,
                          "ssao_errors": errors}))
        return
    table = Table("case", "ms", title=f"{runtime.info.label}, {runtime.form}, {scene}")
    for name, ms in results.items():
        table.add_row(name, f"{ms:.2f}")
    samples = SIZE[0] * SIZE[1] * 16 / results["ssao 16"] / 1e6
    console = Console()
    console.print(table)
    console.print(f"ssao: {samples:.2f} G pixel-samples a second")
    for attenuation, values in errors.items():
        console.print(
            f"ssao against rays, attenuation {attenuation}: RMSE {values['rmse']:.3f}, bias "
            f"{values['bias']:+.3f} (constant image {values['constant']:.3f})"
        )


if __name__ == "__main__":
    main()
