"""Radiosity on surfels: all bounces of light, and the light of emissive surfaces."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import NamedTuple, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.lights import Environment, Light, PunctualLight, environments_of, shines
from ssgi_cl.core.names import Bounces
from ssgi_cl.core.params import Params, Prepared, param, with_fields_described
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.vpls import PARTS, Vpls
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.techniques.direct.shadow_maps import checked_lights
from ssgi_cl.techniques.occupancy.occupancy_grid import GRIDS
from ssgi_cl.techniques.occupancy.scene_rays import rays_carry_first_bounce, rays_meet_triangles
from ssgi_cl.techniques.radiosity.even_light import EvenLight, even_and_bright
from ssgi_cl.techniques.radiosity.gaps import openings
from ssgi_cl.techniques.radiosity.light_volume import CELLS, LightVolume
from ssgi_cl.techniques.radiosity.sky_directions import sky_directions
from ssgi_cl.techniques.radiosity.surface_cells import Pieces, SurfaceCells
from ssgi_cl.techniques.radiosity.surfel_history import STEADY_LIGHTS, SurfelHistory
from ssgi_cl.techniques.radiosity.surfel_hits import SurfelHits
from ssgi_cl.techniques.radiosity.surfel_points import SurfelPoints, hiding_planes
from ssgi_cl.techniques.radiosity.surfel_rays import SurfelRays
from ssgi_cl.techniques.radiosity.surfels import Surfels
from ssgi_cl.techniques.radiosity.surfels_on_device import DeviceSurfels, Spaces
from ssgi_cl.techniques.sky_levels import SkyLevels
from ssgi_cl.techniques.technique import Bench, Technique
from ssgi_cl.techniques.vpl.packed_vpls import DeviceVpls, VplChooser
from ssgi_cl.techniques.vpl.vpl_choice import on_device_rsms
from ssgi_cl.techniques.vpl.world_vpls import WorldVpls

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]

BY_RAYS = 2
"""Surfels for each that is asked for where light between them is found by rays, whose cost grows as their number: that
of pairs grows as its square."""
OPEN_CELLS = 4.0
"""Cells of the volume beyond which the open part of its hemisphere says how much a place counts for its cell."""
GAP = 0.1
"""Part of its hemisphere open to beyond so many cells below which a place lies in a gap, and sends no light as a
virtual point light: a ray to the middle of its surfel does not tell what hides it. Nor does one to a surfel without
room in front of it."""
CONVERGED = 2e-3
"""Share of the flux that the bounces not computed have at most."""
MOST_BOUNCES = 2000
LEAST_ABSORBED = 2e-3
"""Least share of the light absorbed at each bounce: with less the sum of all bounces is not computed."""
LEAP = 5
"""Bounce by rays after which the rest of the series is added. 7 to 9 are computed of rooms in place of 10 to 15, with
less error."""
CERTAIN = 0.97
"""Ratio from which on that bounce tells too little of the rest: light may not yet have come to where it leaves."""
ROUNDED = 1e-5
"""Share of the flux below which a change is rounding, and gives no ratio."""
SETTLED, STEADY = 50, 10
"""Bounces after which the ratio of one to the one before is that of all later ones, and over how many of these it is
found then."""


@dataclass(frozen=True, kw_only=True)
class RadiosityParams(Params):
    """Parameters of radiosity."""

    surfels: int = param(
        2048,
        "pieces that surfaces are divided into, about; twice as many in scenes without holes",
        low=16,
        high=1 << 14,
    )
    bounces: Bounces = param(
        "all",
        "reflections on the way from a light to a pixel: 1 or more, or 'all': until those "
        "to come have less than 0.2 % of the flux",
    )
    emission: bool = param(
        True,
        "the lights that are returned send what surfaces emit, too; False: only what they "
        "reflect, for pixels that emissive surfaces light in another way",
    )
    vpls: int = param(4096, "virtual point lights that are chosen from maps to light surfels", low=16, high=1 << 16)
    directions: int = param(128, "in which a surfel looks for the sky, in scenes with holes", low=16, high=4096)
    grid: int = param(128, "cells along a side of the occupancy grid: 32, 64, 128 or 256", low=32, high=256)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.grid not in GRIDS:
            raise ValueError(f"grid is {self.grid}: expected one of {GRIDS} (cells)")
        bounces = self.bounces
        if bounces != "all" and (
            isinstance(bounces, bool) or not isinstance(bounces, int) or not 1 <= bounces <= MOST_BOUNCES
        ):
            raise ValueError(
                f"bounces is {bounces!r}: expected 'all' or an integer in [1, {MOST_BOUNCES}] (reflections)"
            )


class RadiosityKeywords(TypedDict, total=False):
    """The parameters of `radiosity`."""

    surfels: int
    bounces: Bounces
    emission: bool
    vpls: int
    directions: int
    grid: int


class RadiosityLight(NamedTuple):
    """Light that the surfaces of a scene send, in the forms that its readers take."""

    lights: WorldVpls | None
    """All but the first bounce of maps' lights; None where it is black."""
    volume: Callable[[], LightVolume]
    """Returns all of it, emission included; computed by the first call, as few frames mirror surfaces."""
    even: EvenLight | None
    """That of `lights`, and in scenes of many triangles the first bounce, too, where rays meet triangles; None in other
    scenes, and where it is black."""


class Radiosity(Prepared[RadiosityParams]):
    """Virtual point lights that send all light but what lights from maps send.

    After Goral et al. 1984, "Modeling the Interaction of Light Between Diffuse Surfaces". Departs: surfels for patches.
    In scenes without holes, light from surface to surface is found by rays over the
    hemispheres of surfels' parts, whose hits look up the mean radiance of a cell (`SurfelRays`); no form factors are
    computed. In others a pair of surfels has a form factor and one ray through the occupancy grid, and rows of form
    factors sum to what the sky leaves of a hemisphere. Surfaces reflect and emit on both sides.

    Reflective shadow maps give the first bounce of spot, point and directional lights at pixels;
    surfels carry their later bounces, all bounces of environments, and all light of emissive
    surfaces. Surfaces that face a space which no light enters, as rooms of unlit neighbours and the
    inside of things, have no surfels. Surfels and what they see are kept until another scene comes
    or light enters other spaces; the lights are kept as long as scene, environments and maps stay
    the same.

    Args:
        runtime: the device.
        params: see `RadiosityParams`.

    Attributes:
        surfels: those of the latest scene that see any surface.
        irradiance: [surfels, 3] float64, W/m^2: what they receive, surfaces' emission included.
        vpls: what they send, in host memory, with parts; `run` returns it on the device.
        bounces: reflections that were computed.
    """

    def __init__(self, runtime: Runtime, params: RadiosityParams | None = None) -> None:
        self.runtime = runtime
        self._params = params = params or RadiosityParams()
        self._device = DeviceSurfels(runtime, params.grid)
        self._maps = DeviceVpls(runtime, -(-params.vpls // 16) * 16)
        self._chooser = VplChooser(runtime, (self._maps,))
        self._sky = SkyLevels(runtime)
        self._rays: SurfelRays | None = None
        self._lights: Vpls | None = None  # at the openings of gaps
        self._scene: object = None
        self._key: object = None  # of the scene
        self._history = SurfelHistory()
        self._spaces: Spaces | None = None
        self._lit: object = None
        self._result: RadiosityLight | None = None
        self.irradiance: Doubles = np.zeros((0, 3))
        self.vpls: Vpls | None = None
        self.bounces = 0

    @property
    def surfels(self) -> Surfels:
        """Those of the latest scene."""
        return self._device.surfels

    def run(
        self,
        scene: Scene,
        lights: Sequence[Light],
        *,
        rsms: Sequence[DeviceRsm] = (),
        history: SurfelHistory | None = None,
    ) -> RadiosityLight:
        """Return the light that surfaces send. Waits for the device if it computes.

        Args:
            scene: what is lit.
            lights: of which environments count; the others are in `rsms`.
            rsms: reflective shadow maps of the other lights.
            history: of a sequence in which surfaces move; it is changed.

        Raises:
            ValueError: with bounces="all", surfaces that are closed in absorb too little of the
                light for its bounces to end.
        """
        environments = environments_of(lights)
        # Of maps whose lights are not given, each knows its own.
        punctual = [light for light in lights if not isinstance(light, Environment)] if rsms else []
        punctual = punctual or [rsm.light for rsm in rsms if rsm.light is not None]
        lit = (scene.key, history, environments, tuple(punctual), tuple(rsms), tuple(rsm.version for rsm in rsms))
        if self._result is not None and lit == self._lit:
            self.runtime.skip("radiosity", "scene and lights are the same")
            return self._result
        # Should anything fail, nothing is kept.
        self._lit = self._result = None
        device = self._device
        if self._scene != (scene.key, history):
            self._scene = self._spaces = None
            self._history = history or SurfelHistory(follows=False)
            device.enter(scene, self._history)
            self._scene, self._key = (scene.key, history), scene.key
        records = None
        if rsms:
            self._chooser.place(rsms, device.camera, kinds=1, unit=device.unit)
            records = self._maps.records()
        spaces = device.spaces(records, punctual, sky=any(map(shines, environments)))
        if self._spaces != spaces:
            if history is None and self._spaces is not None:  # light enters other spaces, and surfels are placed anew
                self._history = SurfelHistory(follows=False)
                self._history.enter(scene)
            self._spaces = None
            self._place(scene, spaces, records)
            self._spaces = spaces
        self._result = self._solved(environments, punctual, records)
        self._lit = lit
        return self._result

    def _place(self, scene: Scene, spaces: Spaces, records: Floats | None) -> None:
        """Make the surfels of a scene, the cells that they lie in, and what their rays meet."""
        device, exact = self._device, rays_meet_triangles(scene)
        device.fill(scene, self.params.surfels * (BY_RAYS if exact else 1), spaces, self._history)
        low, extent = device.camera.position - device.half, 2.0 * device.half
        found = None
        if exact and len(device.surfels):
            lit = partial(device.is_lit, dark=spaces.dark)
            found = openings(self.runtime, scene, device.surfels, device.narrow, device.room, lit)
            if found is not None:
                # What is in gaps sends its light at their openings.
                albedo = device.surfels.part_albedo.copy()
                albedo[found.within] = 0.0
                device.surfels = replace(device.surfels, part_albedo=albedo)
        surfels = device.surfels
        pieces = Pieces.of(surfels) if len(surfels) or records is None else self._of_maps(records)[0]
        self._lights = found.lights if found is not None and len(found.lights) else None
        self._first_by_rays = rays_carry_first_bounce(scene)
        self._rays = hits = shown = planes = seen = None
        if exact and len(surfels):
            points = SurfelPoints(self.runtime, scene, surfels, None if found is None else found.sources)
            hits, planes = SurfelHits(points, OPEN_CELLS * extent / CELLS), hiding_planes(points)
            shown, seen = hits.far, hits.seen
            if found is not None:
                shown[found.within] = 0.0
        self._cells = cache(lambda: SurfaceCells(self.runtime, pieces, low, extent, device.unlit, shown, planes, seen))
        self._hidden = np.zeros(len(surfels.part_area), np.bool_)
        if hits is not None:
            self._hidden = (hits.far < GAP) | np.repeat(device.cramped, PARTS)
            self._rays = SurfelRays(hits, self._cells())

    def _solved(
        self, environments: Sequence[Environment], lights: Sequence[PunctualLight], records: Floats | None
    ) -> RadiosityLight:
        surfels, cells = self.surfels, self._cells
        if not len(surfels):
            self.irradiance, self.vpls, self.bounces = np.zeros((0, 3)), None, 0
            flux = np.zeros((0, 3)) if records is None else self._of_maps(records)[1]
            return RadiosityLight(None, cache(lambda: cells().light(flux)), None)
        if self._rays is not None:
            received, direct = self._by_rays(self._rays, environments, lights)
            also = None
        else:
            received, direct = self._by_pairs(environments, records), None
            also = None if records is None else self._of_maps(records)
        shown = sent(surfels, received, emission=True)
        everything = sent(surfels, received, emission=self.params.emission)
        if direct is not None:
            received = received - direct
        self.irradiance = surfels.mean_of_parts(received)
        reflected = sent(surfels, received, emission=self.params.emission)
        self.vpls = _without(reflected, self._hidden)
        volume = cache(lambda: cells().light(_flux(shown), also))
        made = self._on_device(self.vpls) if self.vpls.flux.any() else None
        gathered = everything if self._first_by_rays else reflected
        if self._rays is None or not gathered.flux.any():
            return RadiosityLight(made, volume, None)
        steady = self._history.moves and len(surfels) <= STEADY_LIGHTS * self.params.surfels
        even, bright = even_and_bright(gathered, self._hidden, all_lights=steady)
        if self._lights is not None:
            bright = bright.with_more(self._lights)
        few = self._on_device(bright) if len(bright) else None
        return RadiosityLight(made, volume, EvenLight(cells().light(even), few))

    def _on_device(self, lights: Vpls) -> WorldVpls:
        return WorldVpls(self.runtime, lights, self._device.camera.position)

    def _by_rays(
        self, rays: SurfelRays, environments: Sequence[Environment], lights: Sequence[PunctualLight]
    ) -> tuple[Doubles, Doubles]:
        """Return irradiance [parts, 3] after all bounces, and that of it by punctual lights."""
        surfels = self.surfels
        direct = rays.direct(lights)
        self._sky.set(environments)
        source = rays.sky(self._sky) + rays.emitted + direct
        weight = surfels.part_area[:, None] * surfels.part_albedo

        def bounce(number: int, before: Doubles) -> Doubles:
            if number == 1 and known is None:
                return source
            return source + rays.bounce(self._cells().light(weight * before))

        known, leap = None, None
        if self.params.bounces == "all":
            known, leap = self._history.known(surfels, self._key), LEAP
        received = self._bounced(weight, bounce, known, leap=leap)
        self._history.keep(surfels, self._key, received)
        return received, direct

    def _by_pairs(self, environments: Sequence[Environment], records: Floats | None) -> Doubles:
        """Return irradiance [parts, 3] after all bounces, that of punctual lights from their maps."""
        device, surfels = self._device, self._device.surfels
        ways, solid, radiance = sky_directions(environments, self.params.directions)
        # Kernels count light in that of the brightest source, so that none leaves their range.
        scale = max(math.pi * float(max(radiance.max(), surfels.emission.max())), 1e-30)
        sky = device.look_up(ways, solid, radiance / scale)
        first = np.zeros_like(sky)
        if records is not None:
            gain = self._maps.values["gain"] / scale
            # What maps send may exceed the sky by any factor: the scale follows it.
            raised = max(gain, 1.0)
            first = device.gather_lights(self._maps, records, gain / raised)
            scale, sky = scale * raised, sky / np.float32(raised)
        device.begin((math.pi * surfels.emission / scale).astype(np.float32))

        # Light from maps has been reflected once when it arrives at a surfel, that of the sky and of emissive
        # surfaces not yet.
        def bounce(number: int, before: Doubles) -> Doubles:
            return device.gather(sky if number == 1 else sky + first).astype(np.float64)

        return np.repeat(self._bounced(surfels.area[:, None] * surfels.albedo, bounce) * scale, PARTS, axis=0)

    def _of_maps(self, records: Floats) -> tuple[Pieces, Doubles]:
        """Return the surfaces that maps' lights shine on, and the first bounce that they send, W."""
        device, rows = self._device, records.astype(np.float64)
        turn = device.camera.view[:3, :3]
        watts = self._maps.values["gain"] * device.unit**2
        place = rows[:, :3] * device.unit @ turn + device.camera.position
        return Pieces(place, -rows[:, 4:7] @ turn, rows[:, 3] * device.unit**2), rows[:, 8:11] * watts

    def _bounced(
        self,
        weight: Doubles,
        bounce: Callable[[int, Doubles], Doubles],
        known: Doubles | None = None,
        *,
        leap: int | None = None,
    ) -> Doubles:
        """Return irradiance [n, 3] after as many bounces as the parameters say.

        Args:
            weight: [n, 3] what of it counts for the flux.
            bounce: returns irradiance after so many bounces from that after one less.
            known: irradiance [n, 3] near to that of all bounces, to begin with.
            leap: bounce after which the sum of the series takes the place of what arrived; None: after none.
        """
        wanted = self.params.bounces
        before = np.zeros(weight.shape) if known is None else known
        change, ratio, leapt = np.full(3, math.inf), np.zeros(3), np.zeros(3, np.bool_)
        steps: list[Doubles] = []
        for number in range(1, (MOST_BOUNCES if wanted == "all" else int(wanted)) + 1):
            received = bounce(number, before)
            self.bounces = number
            step = received - before
            latest, total = (np.einsum("nc,nc->c", flux, weight) for flux in (np.abs(step), received))
            now = np.divide(latest, change, out=ratio.copy(), where=change > ROUNDED * total)
            # What is left of an error after the leap falls faster than the series does.
            ratio = np.where(leapt & (number < SETTLED), np.maximum(now, ratio), now)
            before, change = received, latest
            steps.append(latest)
            if number >= SETTLED:
                earlier = np.maximum(steps[-1 - STEADY], ROUNDED * total)
                ratio = np.where(latest > ROUNDED * total, (latest / earlier) ** (1.0 / STEADY), ratio)
            if number < 3:
                continue
            # The bounces to come are a geometric series of this ratio, in each channel.
            rest = ratio / np.maximum(1.0 - ratio, 1e-12)
            if (latest * rest).sum() <= CONVERGED * total.sum():
                break
            if wanted == "all" and number >= SETTLED and ratio.max() > 1.0 - LEAST_ABSORBED:
                raise ValueError(
                    f"bounces is 'all', but surfaces that are closed in absorb {1.0 - ratio.max():.2g} "
                    f"of the light at each bounce: expected {LEAST_ABSORBED} or more (give bounces "
                    "as an integer, or surfaces a lower albedo)"
                )
            if number == leap:
                leapt = ratio < CERTAIN
                before = np.where(leapt, np.maximum(received + rest * step, 0.0), received)
                change = np.where(leapt, math.inf, change)
        return before


def _without(vpls: Vpls, hidden: NDArray[np.bool_]) -> Vpls:
    """Return lights of which the parts that are hidden [parts] send nothing."""
    if not hidden.any():
        return vpls
    parts = vpls.parts
    assert parts is not None  # noqa: S101  those of surfels have some
    flux = np.where(hidden[:, None], 0.0, parts.flux)
    left = Vpls(parts.position, parts.normal, flux, parts.area)
    return Vpls(vpls.position, vpls.normal, flux.reshape(-1, PARTS, 3).sum(axis=1), vpls.area, left)


def _flux(vpls: Vpls) -> Doubles:
    assert vpls.parts is not None  # noqa: S101  those of surfels have some
    return vpls.parts.flux


def sent(surfels: Surfels, irradiance: Doubles, *, emission: bool) -> Vpls:
    """Return the light that surfels send, whose parts receive irradiance [parts, 3] in W/m^2."""
    exitance = surfels.part_albedo * irradiance
    if emission:
        exitance += math.pi * surfels.part_emission
    flux = surfels.part_area[:, None] * exitance
    parts = Vpls(surfels.part_position + surfels.origin, surfels.part_normal, flux, surfels.part_area)
    return Vpls(
        surfels.position + surfels.origin, surfels.normal, flux.reshape(-1, PARTS, 3).sum(axis=1), surfels.area, parts
    )


@with_fields_described(RadiosityParams)
@serialised
def radiosity(
    scene: Scene,
    lights: Sequence[Light],
    *,
    rsms: ReflectiveShadowMap | DeviceRsm | Sequence[ReflectiveShadowMap | DeviceRsm] = (),
    runtime: Runtime | None = None,
    **params: Unpack[RadiosityKeywords],
) -> Vpls:
    """Compute what the surfaces of a scene send after all bounces, as virtual point lights.

    `MultiresSplat` and `VplSplat` make irradiance of pixels from them. What is needed besides is
    the light that `rsms` reflect straight, see `multires_splat`, and that of environments, see
    `sampled_lights`.

    Goral et al. 1984, "Modeling the Interaction of Light Between Diffuse Surfaces". Departs: see
    `Radiosity`.

    Args:
        scene: what is lit. Surfels and what they see are kept for the next call with the same one.
        lights: of which environments count; others are passed over, they are in `rsms`.
        rsms: reflective shadow maps of the other lights, whose later bounces are computed.
        runtime: the device; by default the fastest found.
        **params: the fields of `RadiosityParams`.

    Returns:
        A light for each surfel, with its parts; none where no surface sees another.

    Raises:
        TypeError, ValueError: an argument of the wrong type, a parameter out of range, or, with
            bounces="all", surfaces that are closed in and absorb too little of the light.
    """
    lights = checked_lights(lights, None)
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {type(scene).__name__}: expected a Scene")
    chosen = RadiosityParams(**params)
    maps = on_device_rsms(rsms, runtime)
    device = runtime or (maps[0].runtime if maps else Runtime.open())
    technique: Radiosity = device.prepared((Radiosity, chosen.shape()), lambda: Radiosity(device, chosen))
    with device.frame():
        technique.run(scene, lights, rsms=maps)
    none = np.zeros((0, 3))
    return technique.vpls or Vpls(none, none, none, np.zeros(0))


DESCRIPTOR = Technique(
    name="radiosity",
    kind="indirect",
    paper="Goral et al. 1984",
    function=radiosity,
    params=RadiosityParams,
    technique=Radiosity,
    reference="ssgi_cl.reference.radiosity.radiosity",
    reads=("lights", "rsms", "scene"),
    writes=("vpls",),
    bench=Bench(
        rows={"radiosity": ("what all surfaces send after all bounces", (("2048 surfels, kept", "radiosity.2048"),))}
    ),
)
