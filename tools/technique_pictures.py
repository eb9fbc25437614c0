"""Pictures of docs/techniques: `python -m tools.technique_pictures [NAME ...]`.

Each is a PNG of two or three panels, 320 x 240 pixels, of a built-in scene: the result, and what it is held to; where
that is a reference, the error too. `PICTURES` says what they show.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.io import png
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, BuiltinScene, make_scene

FOLDER = Path(__file__).parents[1] / "docs/images"
WIDTH, HEIGHT = 320, 240
RAYS, PATHS = 256, 512
WHITE_AO, WHITE_LIGHT = 0.25, 1.0
"""Errors that are white: of ambient occlusion, and of light as a share of the reference's mean."""

Picture = NDArray[np.uint8]


@cache
def _scene(name: str) -> tuple[BuiltinScene, gi.Camera, gi.GBuffer]:
    built = BUILTIN_SCENES[name]()
    camera = built.camera(WIDTH, HEIGHT)
    return built, camera, gi.rasterize.gbuffer(built.scene, camera)


@cache
def _rsms(name: str) -> tuple[Any, ...]:
    built, _, _ = _scene(name)
    return gi.shadow_maps(built.scene, built.lights, size=256)


def _maps(name: str) -> list[Any]:
    return [rsm for rsm in _rsms(name) if rsm is not None]


def _grey(share: NDArray[Any]) -> Picture:
    return np.repeat(np.uint8(np.clip(share, 0, 1) * 255 + 0.5)[..., None], 3, axis=-1)


def _error(found: NDArray[Any], reference: NDArray[Any], white: float) -> Picture:
    """Return the absolute error, 0 black; of light the mean of its colours."""
    error = np.abs(np.asarray(found, np.float64) - reference)
    return _grey((error if error.ndim == 2 else error.mean(axis=-1)) / white)


def _light(*panels: NDArray[Any]) -> tuple[Picture, ...]:
    """Return panels of light with one exposure, that of the last."""
    level = panels[-1].mean(axis=-1)
    mean = np.exp(np.mean(np.log(level[level > 0])))
    return tuple(gi.tonemap(np.float32(np.maximum(panel, 0)), exposure=float(0.18 / mean)) for panel in panels)


@cache
def _rays(name: str) -> NDArray[Any]:
    built, camera, gbuffer = _scene(name)
    found: Any = gi.ray_ao(built.scene, camera, radius=built.ao_radius, rays=RAYS, gbuffer=gbuffer)
    return found


@cache
def _paths(name: str) -> NDArray[Any]:
    """Return the one-bounce irradiance of all lights but environments, by paths."""
    built, camera, _ = _scene(name)
    lights = [light for light in built.lights if not isinstance(light, gi.Environment)]
    return gi.truth.one_bounce(built.scene, camera, lights, paths=PATHS).mean


def _occlusion(technique: Callable[..., Any]) -> tuple[Picture, ...]:
    built, _, gbuffer = _scene("hall")
    ao, rays = technique(gbuffer, radius=built.ao_radius), _rays("hall")
    return _grey(ao), _grey(rays), _error(ao, rays, WHITE_AO)


def _reflected(technique: Callable[..., Any], **params: Any) -> tuple[Picture, ...]:
    _, _, gbuffer = _scene("cornell_box")
    return _beside_paths(technique(gbuffer, _maps("cornell_box"), **params))


def _beside_paths(light: NDArray[Any]) -> tuple[Picture, ...]:
    """Return light of the Cornell box, that of paths, and the error."""
    paths = _paths("cornell_box")
    return (*_light(light, paths), _error(light, paths, WHITE_LIGHT * float(paths.mean())))


def _ray_ao() -> tuple[Picture, ...]:
    built, camera, gbuffer = _scene("hall")
    few: Any = gi.ray_ao(built.scene, camera, radius=built.ao_radius, rays=4, gbuffer=gbuffer)
    return _grey(few), _grey(_rays("hall")), _error(few, _rays("hall"), WHITE_AO)


def _multi_bounce() -> tuple[Picture, ...]:
    built, _, gbuffer = _scene("hall")
    ao: Any = gi.gtao(gbuffer, radius=built.ao_radius)
    albedo: Any = gbuffer.albedo
    bright = gi.multi_bounce(ao, albedo)
    return _grey(ao), np.uint8(255 * bright + 0.5)


def _bilateral_blur() -> tuple[Picture, ...]:
    built, _, gbuffer = _scene("hall")
    ao = gi.ssao(gbuffer, radius=built.ao_radius, blur_radius=0)
    return _grey(ao), _grey(gi.bilateral_blur(ao, gbuffer))


def _upsample() -> tuple[Picture, ...]:
    built, _, gbuffer = _scene("hall")
    small = gi.ssao(gbuffer, radius=built.ao_radius)[::4, ::4]
    blocks = np.repeat(np.repeat(small, 4, axis=0), 4, axis=1)[:HEIGHT, :WIDTH]
    return _grey(blocks), _grey(gi.upsample(small, gbuffer, step=4))


def _accumulate() -> tuple[Picture, ...]:
    built, _, _ = _scene("hall")
    forward = 0.004 * np.subtract(built.target, built.eye)
    mean, value, counts, history, previous = np.zeros(0), np.zeros(0), np.zeros(0), None, None
    for frame in range(16):
        place = (15 - frame) * forward
        own = gi.Camera.look_at(built.eye - place, built.target - place, yfov=built.yfov, width=WIDTH, height=HEIGHT)
        gbuffer = gi.rasterize.gbuffer(built.scene, own)
        value = gi.gtao(gbuffer, radius=built.ao_radius, slices=1, blur_radius=0, frame=frame)
        mean, history = gi.accumulate(value, gbuffer, previous, history)
        previous = gbuffer
        counts = history.count / history.count.max()
    return _grey(value), _grey(mean), _grey(counts)


def _shade() -> tuple[Picture, ...]:
    built, _, gbuffer = _scene("hall")
    ao: Any = gi.gtao(gbuffer, radius=built.ao_radius)
    without, shaded = (gi.shade(gbuffer, built.lights, shadow_maps=_rsms("hall"), ao=share) for share in (None, ao))
    return gi.tonemap(without), gi.tonemap(shaded)


def _sampled_lights() -> tuple[Picture, ...]:
    built, _, gbuffer = _scene("hall")
    sky = gi.Environment(1.0)
    ao = gi.gtao(gbuffer, radius=built.ao_radius)
    light = gi.sampled_lights(gbuffer, [sky], scene=built.scene)
    return _light(np.repeat(math.pi * ao[..., None], 3, axis=-1), light)


def _sky_rays() -> tuple[Picture, ...]:
    built = make_scene("window-1")
    gbuffer = gi.rasterize.gbuffer(built.scene, built.camera(WIDTH, HEIGHT))
    sky = [light for light in built.own_lights if isinstance(light, gi.Environment)]
    return _light(gi.sampled_lights(gbuffer, sky, scene=built.scene), gi.sky_rays(gbuffer, sky, scene=built.scene))


def _area_lights() -> tuple[Picture, ...]:
    built, _, gbuffer = _scene("cornell_box")
    return _light(*(gi.area_lights(gbuffer, scene=built.scene, **given) for given in ({"more_rays": 0, "blur": 0}, {})))


def _shadow_maps() -> tuple[Picture, ...]:
    built, _, gbuffer = _scene("hall")
    maps = gi.shadow_maps(built.scene, built.lights)
    return _light(*(gi.shade(gbuffer, built.lights, shadow_maps=each) for each in (None, maps)))


def _blended_layers() -> tuple[Picture, ...]:
    built, camera, _ = _scene("cornell_box")
    scene, box = built.scene, np.ptp(built.scene.bounds, axis=0)
    # Triangles of the blocks: away from all walls.
    corners = scene.positions[scene.triangles] + scene.origin - scene.bounds[0]
    inside = ((corners[..., [0, 2]] > 0.02 * box[[0, 2]]) & (corners[..., [0, 2]] < 0.98 * box[[0, 2]])).all(
        axis=(1, 2)
    )
    inside &= corners[..., 1].max(axis=1) < 0.95 * box[1]
    ids, glass = scene.material_ids.copy(), gi.Material(albedo=(0.4, 0.6, 0.8), alpha=0.5, blends=True)
    ids[inside] = len(scene.materials)
    faded = replace(scene, material_ids=ids, materials=(*scene.materials, glass))
    return tuple(gi.render(each, camera, built.lights).image for each in (scene, faded))


def _radiosity() -> tuple[Picture, ...]:
    built, _, gbuffer = _scene("cornell_box")
    maps, scene = _maps("cornell_box"), built.scene
    once = gi.multires_splat(gbuffer, maps, visibility=True, scene=scene)
    vpls = gi.radiosity(scene, built.lights, rsms=maps)
    params = gi.MultiresSplatParams(vpls=len(vpls), visibility=True)
    return _light(once, once + gi.MultiresSplat(gi.Runtime.open(), (HEIGHT, WIDTH), params)(gbuffer, vpls))


def _reflections() -> tuple[Picture, ...]:
    built, camera, matt = _scene("cornell_box")
    glossy = (replace(material, specular=(0.3,) * 3, gloss=400.0) for material in built.scene.materials)
    scene, maps = replace(built.scene, materials=tuple(glossy)), _maps("cornell_box")
    gbuffer = gi.rasterize.gbuffer(scene, camera)
    irradiance = gi.multires_splat(matt, maps, visibility=True, scene=scene)
    radiance = gi.shade(matt, built.lights, shadow_maps=_rsms("cornell_box"), indirect=irradiance)
    shown = gi.reflections(gbuffer, radiance, built.lights, scene=scene, shadow_maps=_rsms("cornell_box"))
    return _light(radiance, shown)


def _tonemap() -> tuple[Picture, ...]:
    built, _, gbuffer = _scene("hall")
    radiance = gi.shade(gbuffer, built.lights, shadow_maps=_rsms("hall"))
    return gi.tonemap(radiance, curve="clip"), gi.tonemap(radiance)


def _ssdo() -> tuple[Picture, ...]:
    built, _, gbuffer = _scene("cornell_box")
    lights = [light for light in built.lights if not isinstance(light, gi.Environment)]
    _, bounce = gi.ssdo(gbuffer, lights, radius=2.0, shadow_maps=_maps("cornell_box"), slices=4, emission=False)
    return _beside_paths(bounce)


PICTURES: dict[str, Callable[[], tuple[Picture, ...]]] = {
    "ssao": lambda: _occlusion(gi.ssao),
    "hbao": lambda: _occlusion(gi.hbao),
    "gtao": lambda: _occlusion(gi.gtao),
    "bitmask_ao": lambda: _occlusion(gi.bitmask_ao),
    "ray_ao": _ray_ao,
    "multi_bounce": _multi_bounce,
    "bilateral_blur": _bilateral_blur,
    "upsample": _upsample,
    "accumulate": _accumulate,
    "shade": _shade,
    "sampled_lights": _sampled_lights,
    "sky_rays": _sky_rays,
    "area_lights": _area_lights,
    "shadow_maps": _shadow_maps,
    "blended_layers": _blended_layers,
    "radiosity": _radiosity,
    "reflections": _reflections,
    "tonemap": _tonemap,
    "ssdo": _ssdo,
    "rsm_gather": lambda: _reflected(gi.rsm_gather),
    "vpl_splat": lambda: _reflected(
        gi.vpl_splat, visibility=True, interleave=True, scene=_scene("cornell_box")[0].scene
    ),
    "multires_splat": lambda: _reflected(gi.multires_splat, visibility=True, scene=_scene("cornell_box")[0].scene),
}
"""Name of a technique -> makes its panels, from left to right."""


def main(names: list[str]) -> None:
    """Write the pictures of some techniques, or of all."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names or PICTURES:
        first, *rest = PICTURES[name]()
        gap = np.full((HEIGHT, 4, 3), 255, np.uint8)
        path = FOLDER / f"{name}.png"
        png.write(path, np.concatenate([first, *(part for panel in rest for part in (gap, panel))], axis=1))
        print(f"{path.name}: {path.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main(sys.argv[1:])
