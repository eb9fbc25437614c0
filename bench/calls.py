"""Calls of every technique with small inputs: what devices are held to."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.render import render
from ssgi_cl.rasterize import Scene
from ssgi_cl.rasterize import gbuffer as drawn
from ssgi_cl.rasterize import rsm as drawn_map
from ssgi_cl.rasterize.raster.blended_layers import blended_layers
from ssgi_cl.rasterize.raster.shadow_map import shadow_maps
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, make_scene
from ssgi_cl.techniques.ao.gtao import gtao
from ssgi_cl.techniques.ao.multi_bounce import multi_bounce
from ssgi_cl.techniques.area_lights.area_lights import area_lights
from ssgi_cl.techniques.catalogue import of_kind
from ssgi_cl.techniques.direct.light_maps import LightMaps
from ssgi_cl.techniques.direct.shade import shade
from ssgi_cl.techniques.filters.bilateral import bilateral_blur
from ssgi_cl.techniques.filters.tonemap import tonemap
from ssgi_cl.techniques.filters.upsample import coarse_size, upsample
from ssgi_cl.techniques.multires.multires_splat import multires_splat
from ssgi_cl.techniques.radiosity.radiosity import RadiosityParams, radiosity
from ssgi_cl.techniques.reflections.reflections import reflections
from ssgi_cl.techniques.rsm.rsm_gather import rsm_gather
from ssgi_cl.techniques.sampled_lights.sampled_lights import sampled_lights
from ssgi_cl.techniques.sky_rays.sky_rays import sky_rays
from ssgi_cl.techniques.ssdo.ssdo import ssdo
from ssgi_cl.techniques.ssdo.ssdo_params import METHODS
from ssgi_cl.techniques.technique import Technique
from ssgi_cl.techniques.temporal.accumulate import accumulate
from ssgi_cl.techniques.vpl.vpl_splat import vpl_splat

from .drawn import faded, with_holes

Array = NDArray[Any]


@dataclass(frozen=True)
class Inputs:
    """Arguments of the techniques: one room, as some cameras and lights see it.

    Attributes:
        scene: the room.
        gbuffer: two layers with all attributes and a margin.
        single: one layer without a margin or normals.
        view: what an auxiliary camera sees.
        maps: of a spot light, and of a point light.
        lights: those two, the sun and an environment that is an image.
        image: [rows, columns, 3] of the size of `gbuffer`'s results: noise over 8 orders.
    """

    scene: Scene
    gbuffer: GBuffer
    single: GBuffer
    view: GBuffer
    maps: tuple[ReflectiveShadowMap, ReflectiveShadowMap]
    lights: tuple[Any, ...]
    image: NDArray[np.float32]


def inputs(runtime: Runtime, size: Size, texels: int) -> Inputs:
    """Draw the inputs.

    Args:
        runtime: the device that draws them.
        size: (rows, columns) of the images.
        texels: along a side of the lights' maps.
    """
    made = BUILTIN_SCENES["cornell_box"]()
    rows, columns = size
    camera = made.camera(columns, rows)
    punctual_light = PointLight(camera.position + np.array([0.0, 0.3, 0.1]), (1.0, 2.0, 3.0))
    spot = next(light for light in made.lights if isinstance(light, SpotLight))
    spot_map, light_map = (
        drawn_map(made.scene, light, size=texels, runtime=runtime) for light in (spot, punctual_light)
    )
    rng = np.random.default_rng(5)
    single = drawn(made.scene, camera, runtime=runtime)
    return Inputs(
        scene=made.scene,
        gbuffer=drawn(made.scene, camera, layers=2, overscan=0.1, attributes="all", runtime=runtime),
        single=GBuffer(camera=camera, depth=single.depth),
        view=drawn(made.scene, made.camera(-(-columns // 2), -(-rows // 2)), runtime=runtime),
        maps=(spot_map, light_map),
        lights=(
            spot,
            punctual_light,
            DirectionalLight((0.3, -1.0, -0.5), (3.0, 2.0, 1.0), angle=0.05),
            Environment(rng.random((4, 8, 3))),
        ),
        image=(10.0 ** rng.uniform(-4.0, 4.0, (*size, 3))).astype(np.float32),
    )


Call = Callable[[Inputs, Runtime], Iterator[Array]]
"""A function that yields the results of a technique, always as many of the same shapes."""


def drawing(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield depth, normal and albedo of a G-buffer, and flux of two maps."""
    gbuffer = drawn(given.scene, given.gbuffer.camera, layers=2, attributes="all", runtime=runtime)
    depth = np.asarray(gbuffer.depth)
    yield np.where(np.isfinite(depth), depth, 0.0)
    yield np.asarray(gbuffer.normal)
    yield np.asarray(gbuffer.albedo)
    for own in given.maps:
        side = own.cameras[0].width
        yield np.asarray(drawn_map(given.scene, own.light, size=side, runtime=runtime).flux)


def moving(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield motion of a G-buffer whose camera was elsewhere, and thickness of its layers, of closed surfaces."""
    made = make_scene("spot-300")
    camera = made.camera(*given.view.size[::-1])
    shift = np.eye(4)
    shift[:3, 3] = 0.05, 0.02, 0.1
    before = replace(camera, view=shift @ camera.view)
    gbuffer = drawn(made.scene, camera, layers=2, thickness=True, previous_camera=before, runtime=runtime)
    yield np.asarray(gbuffer.motion)
    yield np.asarray(gbuffer.thickness)


def view_normals(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield normals, given ones and those from depth alone."""
    for gbuffer in (given.gbuffer, given.single):
        yield on_device(gbuffer, runtime).normal.download()


def exchanged(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield depth and normal of a G-buffer that comes from device memory of the caller's, and goes to such."""
    arrays = import_module("pyopencl.array")
    depth, normal = (np.ascontiguousarray(each, np.float32) for each in (given.view.depth, given.view.normal))
    device = DeviceGBuffer(runtime, given.view.size)
    depth, normal = (
        arrays.to_device(runtime.queue, each.reshape(*device.size, *each.shape[2:])) for each in (depth, normal)
    )
    device.take(given.view.camera, depth, normal=normal)
    for plane, array in ((device.linear, depth), (device.normal, normal)):
        runtime.copy_to(plane, array).wait()
        yield np.nan_to_num(array.get(), posinf=0.0)


def drawn_maps(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield depth of the maps of a spot light and of the sun."""
    for own in shadow_maps(given.scene, given.lights[::2], size=given.maps[0].cameras[0].width, runtime=runtime):
        depth = np.asarray(None if own is None else own.depth)
        yield np.where(np.isfinite(depth), depth, 0.0)


def light_maps(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield positions, areas and flux of a map that is drawn where it is used."""
    maps = LightMaps(runtime, given.maps[0].cameras[0].width, flux=True)
    with runtime.frame():
        _, found = maps.draw(given.scene, given.lights[:1])
    for plane in (found.position, found.area, found.flux) if found else ():
        yield plane.download()


def seen_through(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield opacity of all layers, and radiance of a frame, of the room as if half of it were there."""
    scene, camera = faded(given.scene), given.gbuffer.camera
    yield np.sum([layer.opacity for layer in blended_layers(scene, camera, runtime=runtime)], axis=0)
    yield np.asarray(render(scene, camera, given.lights, bounces=0, ao=False, shadow_size=16, runtime=runtime).radiance)


def blurred(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield an image after the separable blur and after the other."""
    yield bilateral_blur(given.image, given.gbuffer, runtime=runtime)
    yield bilateral_blur(given.image, given.gbuffer, separable=False, runtime=runtime)


def upsampled(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield images of half and quarter size at full size."""
    for step in (2, 4):
        rows, columns = coarse_size(given.gbuffer.size, step)
        yield upsample(given.image[:rows, :columns], given.gbuffer, step=step, runtime=runtime)


def occluded(technique: Technique) -> Call:
    """Return what yields A with layers and a margin, and A at half size from depth alone."""
    params = {name: values[0] for name, values in technique.variants.items()}

    def run(given: Inputs, runtime: Runtime) -> Iterator[Array]:
        yield technique.function(given.gbuffer, runtime=runtime, **params)
        late = {**params, "resolution": "half", "blur_resolution": "full"}
        yield technique.function(given.single, runtime=runtime, **late)

    return run


def bent(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield A and bent normals."""
    yield from gtao(given.gbuffer, taps=4, falloff=0.6, bent_normals=True, runtime=runtime)


def brightened(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield A with the light that surfaces round a pixel reflect; no kernel does it."""
    yield multi_bounce(np.minimum(given.image[..., 0], 1.0), 0.7)


def directional(method: str) -> Call:
    """Return what yields direct and bounced light, by maps and by what is seen."""

    def run(given: Inputs, runtime: Runtime) -> Iterator[Array]:
        params: dict[str, Any] = {"method": method, "slices": 1, "taps": 4, "samples": 4}
        yield from ssdo(given.gbuffer, given.lights, runtime=runtime, **params)
        yield from ssdo(
            given.single,
            given.lights,
            shadow_maps=(*given.maps, None, None),
            auxiliary_views=[given.view],
            runtime=runtime,
            **params,
        )

    return run


def gathered(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield irradiance with each pattern and each kind of map."""
    spot, punctual_light = given.maps
    yield rsm_gather(given.gbuffer, spot, 200, runtime=runtime)
    yield rsm_gather(given.gbuffer, spot, pattern="all", resolution="adaptive", runtime=runtime)
    for own in given.maps:
        yield rsm_gather(given.gbuffer, own, 50, pattern="rotated", runtime=runtime)
    yield rsm_gather(given.single, punctual_light, 50, pattern="fixed", resolution="adaptive", runtime=runtime)
    yield rsm_gather(given.single, given.maps, 50, method="published", runtime=runtime)


def splatted(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield irradiance by all of some lights, by some for each pixel, and with walls."""
    yield vpl_splat(given.gbuffer, given.maps, 256, runtime=runtime)
    yield vpl_splat(given.gbuffer, given.maps, 256, cutoff=0.0, cull=False, runtime=runtime)
    yield vpl_splat(given.gbuffer, given.maps, 256, interleave=True, visibility=True, runtime=runtime)


def splatted_at_few_pixels(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield irradiance with the defaults, with a cutoff and clamped light, and as published."""
    yield multires_splat(given.gbuffer, given.maps, 256, runtime=runtime)
    yield multires_splat(given.gbuffer, given.maps, 256, cutoff=0.01, near="clamped", runtime=runtime)
    yield multires_splat(given.gbuffer, given.maps, 256, method="published", runtime=runtime)


def shaded(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield radiance, with and without shadows, occlusion and indirect light."""
    ao = np.linspace(0.0, 1.0, given.image[..., 0].size).reshape(given.gbuffer.size)
    lights = given.lights
    yield shade(given.gbuffer, lights, runtime=runtime)
    yield shade(
        given.gbuffer,
        lights,
        shadow_maps=(*given.maps, None, None),
        ao=ao,
        indirect=given.image,
        multi_bounce=True,
        runtime=runtime,
    )


def mapped(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield a picture by either curve, with automatic exposure and with a given one."""
    yield tonemap(given.image, runtime=runtime)
    yield tonemap(given.image, curve="clip", exposure=0.5, runtime=runtime)


FEW = RadiosityParams(surfels=16, bounces=2, vpls=16, directions=16, grid=32)
"""As small as may be."""


def carried(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield what surfaces send of the light of maps and of the sky."""
    yield radiosity(given.scene, given.lights, rsms=given.maps, runtime=runtime, **vars(FEW)).flux


def mirrored(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield radiance of the room as if all of it were glossy, as if it mirrored, and as if it had holes."""
    depth = np.asarray(given.gbuffer.depth)[0]
    smooth = tuple(replace(each, albedo=(0.3,) * 3, specular=(0.5,) * 3, gloss=1e4) for each in given.scene.materials)
    rooms = (given.scene, 60.0), (replace(given.scene, materials=smooth), 1e4), (with_holes(given.scene), 60.0)
    for scene, gloss in rooms:
        yield reflections(
            replace(given.gbuffer, specular=np.full((*depth.shape, 3), 0.5), gloss=np.full(depth.shape, gloss)),
            given.image,
            given.lights,
            scene=scene,
            shadow_maps=(*given.maps, None, None),
            irradiance=given.image,
            radiosity=FEW,
            runtime=runtime,
        )


def sky_lit(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield irradiance by an environment."""
    yield sampled_lights(given.gbuffer, given.lights, scene=given.scene, directions=16, map_size=16, runtime=runtime)


def lit_by_sky(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield irradiance by an environment, with rays."""
    yield sky_rays(given.gbuffer, given.lights, scene=given.scene, runtime=runtime)


def lit_by_surfaces(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield irradiance by emissive surfaces."""
    yield area_lights(given.gbuffer, scene=given.scene, runtime=runtime)


def accumulated(given: Inputs, runtime: Runtime) -> Iterator[Array]:
    """Yield the mean of two frames of a camera that stands still, and of images that move."""
    motion = np.full((*np.shape(given.gbuffer.depth)[-2:], 2), 0.3, np.float32)
    first, history = accumulate(given.image, given.gbuffer, runtime=runtime)
    for gbuffer in (given.gbuffer, replace(given.gbuffer, motion=motion)):
        yield accumulate(first[::-1], gbuffer, given.gbuffer, history, fast=1, runtime=runtime)[0]


CALLS: Mapping[str, Call] = {
    "drawing": drawing,
    "motion and thickness": moving,
    "view normals": view_normals,
    "device memory": exchanged,
    "shadow maps": drawn_maps,
    "light maps": light_maps,
    "blended layers": seen_through,
    "bilateral blur": blurred,
    "upsampling": upsampled,
    **{name.replace("_", " "): occluded(each) for name, each in of_kind("ao").items()},
    "gtao, bent normals": bent,
    "multiple bounces": brightened,
    **{f"ssdo, {method}": directional(method) for method in METHODS},
    "rsm gathering": gathered,
    "vpl splatting": splatted,
    "multiresolution splatting": splatted_at_few_pixels,
    "shading": shaded,
    "tone mapping": mapped,
    "radiosity": carried,
    "reflections": mirrored,
    "sampled lights": sky_lit,
    "sky rays": lit_by_sky,
    "area lights": lit_by_surfaces,
    "accumulation": accumulated,
}
"""Name of a technique, with its method where there are several -> what calls it."""
