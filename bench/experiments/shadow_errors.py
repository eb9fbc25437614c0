"""Errors of shadow maps: `python -m ssgi_cl.bench.experiments.shadow_errors SCENE ...` prints a table.

Of every light the pixels count that show a surface; one is wrong where more than half of the light
is there and a ray to the light meets something, or the reverse.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import png
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene, downloaded
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, VALIDATED_ON, BuiltinScene
from ssgi_cl.reference.direct import shade as reference
from ssgi_cl.techniques.direct.light_data import PunctualLight, PunctualLights, kind_name
from ssgi_cl.techniques.direct.light_maps import LightMaps
from ssgi_cl.techniques.direct.seen_depths import SeenDepths
from ssgi_cl.truth.raycast import RayCaster
from ssgi_cl.tuning.context import Context
from ssgi_cl.tuning.measured_scenes import views_of

from .scan_shadows import towards

MAP_SIZE = 1024
"""Texels along a side of a map: the default of `render`."""

Doubles = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ShadowErrors:
    """The wrong pixels of one light.

    Attributes:
        light: its kind.
        lit, dark: [rows, columns] wrongly lit and wrongly dark pixels.
        seen, facing: [rows, columns] pixels that show a surface, and that the light would reach if
            nothing cast shadows.
        fraction: [rows, columns] of the light that reaches a pixel by the map, 0 where it faces
            away.
        maps: images that the light's shadow map consists of.
    """

    light: str
    lit: Mask
    dark: Mask
    seen: Mask
    facing: Mask
    fraction: Doubles
    maps: int

    @property
    def percent(self) -> tuple[float, float]:
        """Wrongly lit and wrongly dark pixels, percent of the pixels that show a surface."""
        count = max(int(self.seen.sum()), 1)
        return 100.0 * int(self.lit.sum()) / count, 100.0 * int(self.dark.sum()) / count


def shadow_errors(
    view: BuiltinScene,
    runtime: Runtime,
    size: Size,
    *,
    lights: Sequence[PunctualLight] | None = None,
    map_size: int = MAP_SIZE,
    fitted: bool = True,
    caster: RayCaster | None = None,
) -> list[ShadowErrors]:
    """Return the errors of each light of a view.

    Args:
        view: the scene, its camera and its lights.
        runtime: the device.
        size: (rows, columns) of the image.
        lights: in place of the view's punctual lights.
        map_size: texels along a side of a map.
        fitted: whether maps are fitted to what is seen.
        caster: of the scene, made if None.
    """
    context = Context(runtime, view, size)
    punctual_lights = context.punctual_lights if lights is None else tuple(lights)
    scene, camera = view.scene, context.camera
    rasterizer = Rasterizer(runtime, size)
    maps = LightMaps(runtime, map_size, flux=False)
    depths = SeenDepths(runtime, size)
    shading = PunctualLights(runtime, size)
    fractions = []
    with runtime.frame():
        device = rasterizer.render(device_scene(scene, runtime), camera)
        device.derive()
        shadows, _ = maps.draw(scene, punctual_lights, keep=False, seen=depths.find(device) if fitted else None)
        for punctual_light, shadow in zip(punctual_lights, shadows, strict=True):
            planes = []
            for map_ in (None, shadow):
                plane = shading.run(device, [punctual_light], shadows=[map_])
                planes.append(np.zeros(size) if plane is None else plane.download().sum(axis=0, dtype=np.float64))
            free, held = planes
            fractions.append(np.where(free > 0.0, held / np.where(free > 0.0, free, 1.0), 0.0))
    host = downloaded(device)
    caster = caster or RayCaster(scene)
    spots = caster.spots(camera, slice(0, camera.height), host)
    position, normal, _ = reference.world_surface(host)
    seen = np.isfinite(np.asarray(host.depth)).reshape(size)
    found = []
    for punctual_light, fraction, shadow in zip(punctual_lights, fractions, shadows, strict=True):
        strength = reference.direct_reference(punctual_light, position, normal).sum(axis=-1)
        start = spots.start.astype(np.float64) / caster.scale + scene.origin
        faces = strength.reshape(-1)[spots.pixel] > 0.0
        way, length = towards(punctual_light, start[faces], scene.bounds)
        blocked = caster.blocked(spots.start[faces], way.astype(np.float32), (length * caster.scale).astype(np.float32))
        facing, reached = (np.zeros(size, np.bool_) for _ in range(2))
        facing.reshape(-1)[spots.pixel[faces]] = True
        reached.reshape(-1)[spots.pixel[faces]] = ~blocked
        found.append(
            ShadowErrors(
                kind_name(punctual_light),
                facing & ~reached & (fraction > 0.5),
                facing & reached & (fraction < 0.5),
                seen,
                facing,
                fraction,
                0 if shadow is None else len(shadow.crops),
            )
        )
    return found


def picture(errors: ShadowErrors) -> NDArray[np.uint8]:
    """Return [rows, columns, 3]: light in grey, wrongly lit pixels red, wrongly dark ones blue."""
    grey = np.where(errors.seen, 40 + 200 * np.clip(errors.fraction, 0.0, 1.0), 0)
    image = np.repeat(grey.astype(np.uint8)[..., None], 3, axis=-1)
    image[errors.lit] = (255, 0, 0)
    image[errors.dark] = (0, 0, 255)
    return image


@click.command(help=__doc__)
@click.argument("scenes", nargs=-1)
@click.option("--size", nargs=2, type=int, default=(300, 400), help="Rows and columns.")
@click.option("--shadow-size", default=MAP_SIZE, help="Texels along a side of a map.")
@click.option("--whole", is_flag=True, help="Maps of the whole scene, not fitted.")
@click.option("--every-view", is_flag=True, help="Of each scene all views, not the first alone.")
@click.option("--meshes", type=click.Path(path_type=Path), help="The folder of views' meshes.")
@click.option("--pictures", type=click.Path(path_type=Path), help="Folder for PNG files.")
def main(
    scenes: tuple[str, ...],
    size: tuple[int, int],
    shadow_size: int,
    whole: bool,
    every_view: bool,
    meshes: Path | None,
    pictures: Path | None,
) -> None:
    runtime = Runtime.open()
    names = scenes or (*BUILTIN_SCENES, *VALIDATED_ON)
    rows: list[tuple[float, ...]] = []
    click.echo(f"{'view':24}{'light':12} maps  lit %  dark %  facing %")
    for view in views_of(names, runtime, meshes).values():
        caster: Any = RayCaster(view.scene)
        for number, one in enumerate(view.views() if every_view else view.views()[:1]):
            for errors in shadow_errors(one, runtime, size, map_size=shadow_size, fitted=not whole, caster=caster):
                lit, dark = errors.percent
                facing = 100.0 * float(errors.facing.sum()) / max(int(errors.seen.sum()), 1)
                rows.append((lit, dark))
                name = f"{view.name}/{number}"
                click.echo(f"{name:24}{errors.light:12}{errors.maps:5}{lit:7.2f}{dark:8.2f}{facing:10.1f}")
                if pictures is not None:
                    pictures.mkdir(parents=True, exist_ok=True)
                    file = f"{view.name}-{number}-{len(rows)}.png"
                    png.write(pictures / file, picture(errors))
    lit, dark = np.mean(rows, axis=0) if rows else (0.0, 0.0)
    worst = max((sum(row) for row in rows), default=0.0)
    click.echo(f"{'mean':41}{lit:7.2f}{dark:8.2f}   worst sum {worst:.2f}")


if __name__ == "__main__":
    main()
