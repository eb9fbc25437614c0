"""Choice of virtual point lights: pieces of equal luminous flux of the lit texels of maps."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial

import numpy as np

from ssgi_cl.core import checks
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.vpls import MOST_VPLS, PARTS, Doubles, Vpls
from ssgi_cl.device.rsm import DeviceRsm, on_device_rsm
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.techniques.vpl.flux_curve import FluxCurve, FoundPlaces, curve_key


class ChosenVpls:
    """Virtual point lights chosen from maps in device memory, where they stay.

    The texels of all maps are strung along Hilbert curves and cut into pieces of equal luminous
    flux. Each piece gives a light at its middle, with all of its flux and area. Where no more
    texels are lit than `count`, each of them is a light, and those beyond have no flux.

    Args:
        curve: the sums along the maps' texels.
        count: of lights, at most that of all texels.
        parts: whether the lights have parts.

    Attributes:
        places: where the lights are.
        part_places: where their parts are, or None.
        edges: flux and area in front of each light, or of each part if there are any.
        split: pieces of a light: 1, or PARTS.
    """

    def __init__(self, curve: FluxCurve, count: int, *, parts: bool = False) -> None:
        runtime = curve.runtime
        self.curve = curve
        self.count = count
        self.split = PARTS if parts else 1
        self.places = FoundPlaces(runtime, count, middle=True, glossy=curve.glossy)
        self.part_places = FoundPlaces(runtime, count * PARTS, middle=True) if parts else None
        self.edges = FoundPlaces(runtime, count * self.split + 1, middle=False)
        self._version = 0

    def update(self) -> None:
        """Queue the passes that choose, unless the sums are those of last time."""
        if self._version == self.curve.version:
            return
        self._version = -1  # should anything fail, they are of no sums
        self.curve.cut(self.edges, self.count, self.split)
        self.curve.cut(self.places, self.count, 1, self.edges)
        if self.part_places is not None:
            self.curve.cut(self.part_places, self.count, PARTS, self.edges)
        self._version = self.curve.version

    def download(self) -> Vpls:
        """Return a copy in host memory, parts left out where each light is a texel."""
        lit = self.curve.lit()
        count = min(self.count, lit)
        edges = self.edges.download()[:, : count * self.split + 1]
        if self.part_places is None or lit <= self.count:
            return self._lights(self.places, edges[:, :: self.split])
        parts = self._lights(self.part_places, edges)
        lights = self._lights(self.places, edges[:, :: self.split])
        return Vpls(lights.position, lights.normal, lights.flux, lights.area, parts)

    def _lights(self, places: FoundPlaces, edges: Doubles) -> Vpls:
        amounts = np.diff(edges, axis=1)
        found = places.download()[:, : amounts.shape[1]]
        lobe = (None, found[6:9].T, found[9]) if self.curve.glossy else ()
        return Vpls(found[:3].T + self.curve.origin, found[3:6].T, amounts[:3].T, amounts[3], *lobe)


@serialised
def choose_vpls(
    rsms: ReflectiveShadowMap | DeviceRsm | Sequence[ReflectiveShadowMap | DeviceRsm],
    count: int = 1024,
    *,
    parts: bool = False,
    glossy: bool = False,
    runtime: Runtime | None = None,
) -> Vpls:
    """Choose virtual point lights in proportion to flux, spread evenly over what is lit.

    The texels of all maps are strung along Hilbert curves and cut into `count` pieces of equal
    luminous flux. Each piece gives a light at its middle, with all of its flux and area, so that
    the sum of the flux is that of the maps. Pieces of a Hilbert curve are compact, which makes this
    a warp that stratifies in two dimensions; nothing is random, so little changes when the light
    moves a little.

    Args:
        rsms: a reflective shadow map, or one for each light.
        count: of lights, >= 1. If no more texels are lit than that, each of them is one.
        parts: give the lights' parts too, unless every texel is a light; not with `glossy`.
        glossy: lights with lobes, for what glossy surfaces mirror; flux then counts by
            sqrt(n + 1) more, so that sharper lobes get more lights. Maps without any give none.
        runtime: the device; by default the fastest found.

    Returns:
        `count` lights or fewer; none if no texel is lit.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
    """
    count = checks.integer("vpls", count, low=1, high=MOST_VPLS, unit="virtual point lights")
    checks.switch("glossy", glossy)
    if glossy and parts:
        raise ValueError("parts is True: expected False with glossy=True, lobes have no parts")
    maps = on_device_rsms(rsms, runtime)
    if glossy:
        maps = [rsm for rsm in maps if rsm.lobes is not None]
    if not maps:
        none, lobe = np.zeros((0, 3)), (None, np.zeros((0, 3)), np.zeros(0)) if glossy else ()
        return Vpls(none, none, none, np.zeros(0), *lobe)
    chosen = _chosen_vpls(maps, count, parts=parts, glossy=glossy)
    with chosen.curve.runtime.frame():
        chosen.curve.update(maps)
        chosen.update()
    return chosen.download()


def _chosen_vpls(maps: Sequence[DeviceRsm], count: int, *, parts: bool, glossy: bool) -> ChosenVpls:
    """Return the object that chooses from maps of these sizes, kept between calls; nothing is queued."""
    runtime, key = maps[0].runtime, curve_key(maps)

    def make() -> ChosenVpls:
        curve: FluxCurve = runtime.prepared((FluxCurve, key, glossy), lambda: FluxCurve(runtime, key, glossy=glossy))
        return ChosenVpls(curve, min(count, curve.texels), parts=parts)

    chosen: ChosenVpls = runtime.prepared((ChosenVpls, key, count, parts, glossy), make)
    return chosen


def on_device_rsms(
    rsms: ReflectiveShadowMap | DeviceRsm | Sequence[ReflectiveShadowMap | DeviceRsm], runtime: Runtime | None
) -> list[DeviceRsm]:
    """Return one or several maps in device memory, uploaded unless they are there already.

    Maps of one size would share the memory that `on_device_rsm` keeps, so each has its own here.
    """
    given = tuple(rsms) if isinstance(rsms, Iterable) else (rsms,)
    maps = []
    for index, rsm in enumerate(given):
        if index == 0 or not isinstance(rsm, ReflectiveShadowMap):
            maps.append(on_device_rsm(rsm, runtime))
            continue
        runtime = runtime or Runtime.open()
        size, faces = rsm.cameras[0].size, len(rsm.cameras)
        glossy = rsm.specular_flux is not None
        device: DeviceRsm = runtime.prepared(
            (on_device_rsms, index, size, faces, glossy), partial(DeviceRsm, runtime, size, faces, glossy=glossy)
        )
        device.upload(rsm)
        maps.append(device)
    return maps
