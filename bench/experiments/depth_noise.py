"""Noise of depth cameras: `python -m ssgi_cl.bench.experiments.depth_noise --help`."""

from __future__ import annotations

from time import perf_counter

import click
import numpy as np

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import make_scene

SCENES = ("hall", "parlour", "workshop", "room-7", "room-11", "colonnade-3")
DISTANCE = 3.0
"""Median distance in metres that scenes are brought to."""
NOISE = 0.0015
"""Standard deviation of depth in metres, of its square: a structured-light camera of 2012."""
RADIUS = 0.5


@click.command()
@click.option("--size", type=(int, int), default=(320, 240), show_default=True, help="Columns and rows.")
@click.option("--scene", "scenes", multiple=True, default=SCENES, show_default=True, help="A built-in scene; several.")
def main(size: tuple[int, int], scenes: tuple[str, ...]) -> None:
    """Print the RMSE of ambient occlusion of noisy depth, and of what `clean_depth` makes of it."""
    click.echo("| scene | AO, noisy | AO, cleaned | depth, noisy, mm | depth, cleaned, mm | s |")
    click.echo("|---|---:|---:|---:|---:|---:|")
    for name in scenes:
        room, rng = make_scene(name), np.random.default_rng(1)
        camera = room.camera(*size)
        drawn = np.asarray(gi.rasterize.gbuffer(room.scene, camera).depth, np.float64)
        seen = np.isfinite(drawn)
        true = np.where(seen, drawn * DISTANCE / np.median(drawn[seen]), np.inf)
        noisy = true + np.where(seen, NOISE * true**2, 0.0) * rng.standard_normal(true.shape)
        start = perf_counter()
        cleaned = gi.clean_depth(noisy)
        seconds = perf_counter() - start
        own = gi.Camera(view=np.eye(4), projection=camera.projection, width=size[0], height=size[1])
        ao = [gi.gtao(gi.GBuffer(camera=own, depth=depth), radius=RADIUS) for depth in (true, noisy, cleaned)]
        errors = [float(np.sqrt(np.mean((one - ao[0]) ** 2))) for one in ao[1:]]
        off = [1e3 * float(np.median(np.abs(depth[seen] - true[seen]))) for depth in (noisy, cleaned)]
        click.echo(f"| {name} | {errors[0]:.3f} | {errors[1]:.3f} | {off[0]:.2f} | {off[1]:.2f} | {seconds:.2f} |")


if __name__ == "__main__":
    main()
