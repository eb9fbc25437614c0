"""The stages of the pipeline as records, see `ssgi_cl.frame.stage`.

Each function returns the record of one stage; a new one is added to the list that `Renderer` makes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment, Light, shines
from ssgi_cl.core.scene_parts import scene_parts
from ssgi_cl.device.active_region import Region
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.auxiliary_views import AuxiliaryViews
from ssgi_cl.frame.blended import Blended
from ssgi_cl.frame.lobes import Lobes
from ssgi_cl.frame.one_bounce import OneBounce
from ssgi_cl.frame.stage import Resource, Stage, Values
from ssgi_cl.frame.tile_classifier import OpenTileFinder, TiledOcclusion
from ssgi_cl.rasterize.rasterizer import Rasterizer
from ssgi_cl.rasterize.view import device_scene
from ssgi_cl.techniques.indirect.multires_splat import MultiresSplat
from ssgi_cl.techniques.indirect.radiosity import Radiosity
from ssgi_cl.techniques.indirect.ssdo import Ssdo
from ssgi_cl.techniques.indirect.world_vpls import WorldVpls
from ssgi_cl.techniques.sampled_lights import SampledLights
from ssgi_cl.techniques.shading.light_data import kind_name, power
from ssgi_cl.techniques.shading.light_maps import LightMaps
from ssgi_cl.techniques.shading.light_reach import reaching
from ssgi_cl.techniques.shading.seen_depths import SeenDepths
from ssgi_cl.techniques.shading.shade import Shade
from ssgi_cl.techniques.shading.tonemap import Tonemap, auto_exposure
from ssgi_cl.techniques.tiles import Tiles

SCENE, CAMERA, LIGHTS, MULTI_BOUNCE = "scene", "camera", "lights", "multi_bounce"
CASTING = "surfaces that light meets"
SKY = "lights as the background shows them"
AO_PARAMS, INDIRECT_PARAMS = "parameters of occlusion", "parameters of indirect light"
GBUFFER, TILES, IDLE_LIGHTS = "G-buffer", "tile classes", "idle lights"
AO, DIRECT, INDIRECT = "ambient occlusion", "direct irradiance", "indirect irradiance"
SHADOWS, RSM = "shadow maps", "reflective shadow map"
SCENE_LIGHT, SKY_LIGHT = "light of surfaces", "irradiance by environments"
RADIANCE, PIXELS, EXPOSURE, IMAGE = "radiance", "radiance on the host", "exposure", "image"

RESOURCES = (
    Resource(SCENE, given=True, key=lambda scene: scene.key),
    Resource(CASTING, given=True, key=lambda scene: scene.key),
    Resource(CAMERA, given=True),
    Resource(LIGHTS, given=True),
    Resource(SKY, given=True),
    Resource(MULTI_BOUNCE, given=True),
    Resource(AO_PARAMS, given=True),
    Resource(INDIRECT_PARAMS, given=True),
    Resource(EXPOSURE, given=True, by_value=True),
    Resource(RSM, absent="no light that a map could be made of"),
)
"""Of which more than the name is to be known."""


def gbuffer_stage(rasterizer: Rasterizer, look: Callable[[DeviceGBuffer], None] | None) -> Stage:
    """Return the stage that draws the G-buffer.

    Args:
        rasterizer: draws it.
        look: queues what needs normals in world space, whose memory goes to others then; or None.
    """
    runtime, regions = rasterizer.runtime, rasterizer.regions

    def run(r: Values) -> DeviceGBuffer:
        parts = scene_parts(r[SCENE])
        # What is seen through may lie beyond the region of what is not.
        rasterizer.regions = regions and parts.blended is None
        seen: DeviceGBuffer = rasterizer.render(device_scene(parts.solid, runtime), r[CAMERA])
        if seen.region is not None:
            rows, columns = seen.region.rows, seen.region.columns
            why = f"nothing is seen outside of {columns} x {rows} pixels"
            runtime.skip("region", why, 0.0)
        seen.derive()
        if look is not None:
            look(seen)
        seen.release_world()
        return seen

    return Stage(name="G-buffer", reads=(SCENE, CAMERA), writes=(GBUFFER,), run=run, releases=("ssdo",))


def tiles_stage(tiles: Tiles, condition: Callable[[Values], str | None]) -> Stage:
    """Return the stage that classifies tiles of the G-buffer; see `Stage.condition`."""
    return Stage(
        name="tile summary",
        reads=(GBUFFER,),
        writes=(TILES,),
        run=lambda r: tiles.look(r[GBUFFER]),
        condition=condition,
        silent=True,
    )


def ssdo_tiles_condition(
    ssdo: Ssdo, seen: DeviceGBuffer, condition: Callable[[Values], str | None]
) -> Callable[[Values], str | None]:
    """Return `condition`, and that SSDO says how far it looks in the G-buffer `seen`."""

    def both(facts: Values) -> str | None:
        if ssdo.reach(seen) is None:
            return "no tile is proven open where planes hide themselves"
        return condition(facts)

    return both


def occlusion_stage(ao: TiledOcclusion, tiles: Tiles | None, skips: frozenset[str], *, dims_indirect: bool) -> Stage:
    """Return the stage of ambient occlusion.

    Args:
        ao: the technique.
        tiles: what classifies tiles, if anything may be left out for that.
        skips: see `plan.SKIPS`; "dark", "tiles" and "layers" count.
        dims_indirect: whether indirect light is dimmed too.
    """

    def condition(facts: Values) -> str | None:
        if AO in facts["outputs"] or dims_indirect or "dark" not in skips:
            return None
        lit = any(_is_ambient(light) for light in facts[LIGHTS])
        return None if lit else "no ambient light for it to dim"

    hints = (TILES,) if tiles is not None and skips & {"tiles", "layers"} else ()
    return Stage(
        name=ao.name,
        reads=(GBUFFER, AO_PARAMS),
        hints=hints,
        writes=(AO,),
        condition=condition,
        run=lambda r: ao.run(r[GBUFFER], tiles=tiles, summary=r.get(TILES)),
        culled="no output that it changes",
    )


def idle_lights_stage(runtime: Runtime, costs: dict[str, float]) -> Stage:
    """Return the stage that finds the lights which light nothing that is seen.

    `costs` are those of the graph.
    """

    def condition(facts: Values) -> str | None:
        punctual_lights = any(not isinstance(light, Environment) for light in facts[LIGHTS])
        return None if punctual_lights else "no spot, point or directional light"

    def run(r: Values) -> set[int]:
        if r[TILES] is None:
            return set()
        punctual_lights = {
            index: light
            for index, light in enumerate(r[LIGHTS])
            if not isinstance(light, Environment) and power(light).any()
        }
        reach = reaching(list(punctual_lights.values()), r[TILES].boxes, r[CAMERA])
        idle = {
            index: light for (index, light), reaches in zip(punctual_lights.items(), reach, strict=True) if not reaches
        }
        for light in idle.values():
            kind = kind_name(light)
            why = "all that is seen is turned away from it or outside its cone"
            # Its light would be found to be none soon, but not before its map is drawn.
            runtime.skip(f"light {kind}", why, costs.get(f"map {kind}", 0.0))
        return set(idle)

    return Stage(
        name="idle lights",
        reads=(CAMERA, LIGHTS),
        hints=(TILES,),
        writes=(IDLE_LIGHTS,),
        run=run,
        condition=condition,
        reuse="every frame",
        silent=True,
    )


def maps_stage(maps: LightMaps, depths: SeenDepths | None, *, keep: bool, reflects: bool, all_lights: bool) -> Stage:
    """Return the stage that draws the maps of lights.

    Args:
        maps: what draws them.
        depths: finds what is seen, which shadow maps are fitted to; None: they show everything.
        keep: whether maps are kept where neither light nor scene changed.
        reflects: whether what reflects light is asked for too.
        all_lights: whether lights have maps that light nothing that is seen.
    """

    def run(r: Values) -> Any:
        idle = r.get(IDLE_LIGHTS) or ()
        lit = any(
            index not in idle and not isinstance(light, Environment) and power(light).any()
            for index, light in enumerate(r[LIGHTS])
        )
        seen = depths.find(r[GBUFFER]) if depths is not None and lit else None
        shadows, rsm = maps.draw(r[CASTING], r[LIGHTS], idle=idle, keep=keep, seen=seen)
        return (shadows, rsm) if reflects else shadows

    return Stage(
        name="shadow maps",
        reads=(CASTING, LIGHTS, *((GBUFFER,) if depths is not None else ())),
        hints=() if all_lights else (IDLE_LIGHTS,),
        writes=(SHADOWS, RSM) if reflects else (SHADOWS,),
        run=run,
        reuse="on demand",
    )


def direct_stage(shade: Shade) -> Stage:
    """Return the stage of direct light."""

    def run(r: Values) -> Plane | None:
        lights, shadows, idle = r[LIGHTS], r[SHADOWS], r[IDLE_LIGHTS] or ()
        lit = [i for i in range(len(lights)) if i not in idle]
        return shade.light(r[GBUFFER], [lights[i] for i in lit], shadows=[shadows[i] for i in lit])

    return Stage(name="direct light", reads=(GBUFFER, LIGHTS, SHADOWS), hints=(IDLE_LIGHTS,), writes=(DIRECT,), run=run)


def radiosity_stage(radiosity: Radiosity) -> Stage:
    """Return the stage that carries light from surface to surface, seen or not.

    It depends on scene and lights alone, so that a moving camera does not run it again.
    """

    def run(r: Values) -> WorldVpls | None:
        maps = r.get(RSM)
        return radiosity.run(r[CASTING], r[LIGHTS], rsms=[] if maps is None else [maps])

    return Stage(name="radiosity", reads=(CASTING, LIGHTS), hints=(RSM,), writes=(SCENE_LIGHT,), run=run)


def sky_light_stage(sky: SampledLights) -> Stage:
    """Return the stage of the light of environments, which all triangles block."""
    return Stage(
        name="sky light",
        reads=(GBUFFER, CASTING, LIGHTS),
        writes=(SKY_LIGHT,),
        run=lambda r: sky.run(r[GBUFFER], r[LIGHTS], scene=r[CASTING]),
        condition=lambda given: None if any(map(_is_ambient, given[LIGHTS])) else "no environment shines",
    )


def final_gather_stage(splat: MultiresSplat, runtime: Runtime) -> Stage:
    """Return the stage of the light that surfaces reflect and emit: of punctual lights once by
    virtual point lights of their maps, all else by surfels."""

    def run(r: Values) -> Plane:
        maps = r.get(RSM)
        other = [r.get(name) for name in (SKY_LIGHT, DIRECT)]
        return splat.run(
            r[GBUFFER],
            rsms=[] if maps is None else [maps],
            scene=device_scene(r[CASTING], runtime),
            surfels=r[SCENE_LIGHT],
            other_light=[plane for plane in other if plane is not None],
        )

    return Stage(
        name="bounce",
        reads=(GBUFFER, CASTING, LIGHTS, SCENE_LIGHT, SKY_LIGHT, DIRECT),
        hints=(RSM,),
        writes=(INDIRECT,),
        run=run,
        label=splat.name,
    )


def one_bounce_stage(bounce: OneBounce, runtime: Runtime) -> Stage:
    """Return the stage of the light that surfaces reflect once."""

    def run(r: Values) -> Plane:
        scene = device_scene(r[CASTING], runtime) if bounce.blocked else None
        return bounce.run(r[GBUFFER], r[RSM], scene=scene)

    return Stage(
        name="bounce",
        reads=(GBUFFER, RSM, INDIRECT_PARAMS, *((CASTING,) if bounce.blocked else ())),
        writes=(INDIRECT,),
        run=run,
        label=bounce.name,
    )


def ssdo_stages(ssdo: Ssdo, opener: OpenTileFinder, tiles: Tiles | None, views: AuxiliaryViews | None) -> list[Stage]:
    """Return the stage of directional occlusion, and that of the occlusion which it replaces.

    Args:
        ssdo: the technique.
        opener: finds open tiles for it.
        tiles: what classifies tiles, if any may be left out.
        views: draws what auxiliary cameras see.
    """

    def run(r: Values) -> tuple[Plane | None, Plane | None]:
        seen, lights = r[GBUFFER], r[LIGHTS]
        extra = views.drawn(r[CASTING], r[CAMERA], seen, lights) if views is not None else ()
        known = None if r.get(TILES) is None else tiles
        open_ = opener.find(seen, known, ssdo.reach(seen))
        found = ssdo.run(seen, lights, shadows=r[SHADOWS], auxiliary_views=extra, tiles=open_)
        return found.direct, found.bounce

    replaced = Stage(
        name="ambient occlusion",
        reads=(GBUFFER,),
        writes=(AO,),
        run=lambda r: None,
        condition=lambda facts: "ssdo hides ambient light by itself",
    )
    return [
        replaced,
        Stage(
            name="ssdo",
            reads=(GBUFFER, CASTING, CAMERA, LIGHTS, SHADOWS, INDIRECT_PARAMS),
            hints=(AO,) if tiles is None else (AO, TILES),
            writes=(DIRECT, INDIRECT),
            run=run,
        ),
    ]


def combine_stage(
    shade: Shade,
    reads: Iterable[str],
    *,
    ambient: bool,
    indirect_ao: bool,
    gaps: bool,
    lobes: Lobes | None,
    blended: Blended,
    layer_stages: Sequence[Stage],
    layer_ambient: bool,
) -> Stage:
    """Return the stage that sums up all light.

    Args:
        shade: what does it.
        reads: the kinds of light and occlusion that there are, by name.
        ambient: whether the light of environments is not in direct light yet.
        indirect_ao: whether ambient occlusion dims indirect light too.
        gaps: whether it does so at least where it is below 1/2.
        lobes: adds what glossy surfaces reflect; None: nothing does.
        blended: adds surfaces that are seen through.
        layer_stages: which of those before run for each layer of these too.
        layer_ambient: whether the light of environments is in none of them.
    """
    made = {name for stage in layer_stages for name in stage.writes}

    def combined(r: Values, *, ambient: bool) -> Plane:
        seen = r[GBUFFER]
        light = None if lobes is None else lobes.needs(seen, r[CASTING])
        radiance = shade.combine(
            seen,
            r[SKY],
            r[DIRECT],
            ambient=ambient,
            visibility=r.get(AO),
            indirect=r.get(INDIRECT),
            multi_bounce=r[MULTI_BOUNCE],
            indirect_ao=indirect_ao,
            gaps=gaps,
            sky_light=r.get(SKY_LIGHT),
            light=light,
        )
        if lobes is not None and light is not None:
            lobes.run(seen, radiance, light, r[LIGHTS], r[SHADOWS])
        return radiance

    def shaded(r: Values, layer: DeviceGBuffer) -> Plane:
        values = {**r, GBUFFER: layer, **dict.fromkeys((AO, DIRECT, INDIRECT, SKY_LIGHT))}
        for stage in layer_stages:
            (name,) = stage.writes
            values[name] = stage.run(values)
        return combined(values, ambient=layer_ambient)

    def run(r: Values) -> Plane:
        radiance = combined(r, ambient=ambient)
        blended.run(
            r[SCENE],
            r[CAMERA],
            r[GBUFFER],
            radiance,
            lambda layer: shaded(r, layer),
            overwritten=[r.get(name) for name in sorted(made)],
        )
        return radiance

    of_layers = {name for stage in layer_stages for name in stage.reads} - made - {GBUFFER}
    also = () if lobes is None else (CASTING, LIGHTS, SHADOWS, SCENE_LIGHT)
    names = dict.fromkeys((GBUFFER, SCENE, CAMERA, SKY, MULTI_BOUNCE, *reads, *also, *sorted(of_layers)))
    hints = {name for stage in layer_stages for name in stage.hints} - set(names)
    return Stage(name="combine", reads=tuple(names), hints=tuple(sorted(hints)), writes=(RADIANCE,), run=run)


def picture_stages(shade: Shade, tonemap: Tonemap) -> list[Stage]:
    """Return the stages from radiance to the picture: read-back, exposure, tone mapping."""

    def expose(r: Values) -> float:
        return auto_exposure(r[PIXELS], shade.seen(r[GBUFFER]))

    return [
        Stage(
            name="read-back",
            reads=(RADIANCE, GBUFFER),
            writes=(PIXELS,),
            reuse="on demand",
            run=lambda r: pixels(r[RADIANCE], shade.seen(r[GBUFFER])),
        ),
        Stage(name="exposure", reads=(PIXELS, GBUFFER), writes=(EXPOSURE,), run=expose),
        Stage(
            name="picture",
            reads=(RADIANCE, GBUFFER, EXPOSURE),
            writes=(IMAGE,),
            run=lambda r: tonemap.run(r[RADIANCE], exposure=r[EXPOSURE], region=shade.seen(r[GBUFFER])),
        ),
    ]


def pixels(plane: Plane, region: Region | None = None) -> NDArray[np.float32]:
    """Return [rows, columns, channels] of a plane, whose pixels outside a region are the same."""
    found = np.empty((*plane.size, plane.count), np.float32)
    plane.download(np.moveaxis(found, -1, 0), region)
    return found


def _is_ambient(light: Light) -> bool:
    return isinstance(light, Environment) and shines(light)
