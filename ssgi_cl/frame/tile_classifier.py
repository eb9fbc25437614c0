"""Tiles of a frame that are proven unoccluded, and ambient occlusion without them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.transient import TransientPlane
from ssgi_cl.frame.render_params import ao_technique
from ssgi_cl.techniques.ao.occlusion import OcclusionParams
from ssgi_cl.techniques.tiles import OpenTiles, Reach, Tiles, TileSummary

WORTH = 0.125
"""Share of open tiles that saves what it costs to find them."""


REST = 7
"""Frames that don't look at the tiles after one where that brought nothing: a look costs up to a
twentieth of a frame."""


class TileRest:
    """Says when to look at the tiles again, where the latest look saved nothing."""

    def __init__(self) -> None:
        self._frames = 0
        self._rests = False
        self._of: tuple[object, int] = (None, 0)

    def begin(self, scene_key: object, lights: int) -> None:
        """Count a frame of a scene with so many lights; another scene or number begins anew."""
        if self._of[0] is not scene_key or self._of[1] != lights:
            self._frames, self._of = 0, (scene_key, lights)
        self._rests = self._frames > 0
        self._frames -= self._rests

    def condition(self, _: Mapping[str, Any]) -> str | None:
        """Return why this frame does not look at its tiles, or None."""
        if not self._rests:
            return None
        return f"the latest look saved nothing; {self._frames} more frames do without"

    def learn(self, pays: bool) -> None:
        """Take note whether a look saved anything."""
        self._frames = 0 if pays else REST


class OpenTileFinder:
    """Finds the open tiles of frames for a technique, and notes what they save.

    Args:
        runtime: the device.
        name, cost: of the technique, and of its pass that open tiles save.

    Attributes:
        pays: whether the latest frame had enough of them.
    """

    def __init__(self, runtime: Runtime, name: str, cost: str) -> None:
        self.runtime = runtime
        self.name = name
        self.pays = False
        self._cost = cost
        self._busy = 0  # tiles that the latest frame computed
        self._speed = (0, 0.0)  # of the frame with the most: their number, ms for each

    def find(self, seen: DeviceGBuffer, tiles: Tiles | None, reach: Reach | None) -> OpenTiles | None:
        """Queue the passes that find open tiles; None if none is, or nothing is known of tiles or
        of how far the technique looks."""
        self._busy = 0
        self.pays = False
        if tiles is None or reach is None:
            return None
        known = tiles.open(seen, reach)
        self._busy = known.total - known.open
        self.pays = known.open >= WORTH * known.total
        if not known.open:
            return None  # so that kernels need not look at the tiles
        self.runtime.skip(f"{self.name} tiles", known.why, known.open * self._speed[1])
        return known

    def learn(self, costs: Mapping[str, float]) -> None:
        """Take from what the passes of a frame took, in ms by name, what a tile takes."""
        if self._busy and self._busy >= self._speed[0] and self._cost in costs:
            self._speed = self._busy, costs[self._cost] / self._busy


class TiledOcclusion:
    """A technique of ambient occlusion that leaves out tiles and layers, prepared for one size.

    Args:
        runtime: the device.
        size, margin, layers: of the G-buffers.
        params: of the technique, which say which it is.
        skips: see `plan.SKIPS`; "tiles" and "layers" count.

    Attributes:
        name: of the technique.
        pays: whether the latest run left out enough to look at tiles for.
    """

    def __init__(
        self, runtime: Runtime, size: Size, params: OcclusionParams, margin: Size, layers: int, skips: frozenset[str]
    ) -> None:
        self.runtime = runtime
        self.name, self._technique = ao_technique(runtime, size, params, margin, layers)
        self._layers = layers
        self._skips = skips
        self._size = size
        self._has_one = params.channels == 1
        self.pays = False
        self._opener = OpenTileFinder(runtime, self.name, self.name)

    def run(self, gbuffer: DeviceGBuffer, *, tiles: Tiles | None = None, summary: TileSummary | None = None) -> Plane:
        """Queue the passes; return the plane of A.

        `summary` are what `tiles` found in the G-buffer, both None if nothing is to be left out.
        """
        layers = None
        if summary is not None and "layers" in self._skips and summary.layers < self._layers:
            layers = summary.layers
            missing = f"{self._layers - layers} of {self._layers} have no pixel"
            self.runtime.skip(f"{self.name} layers", missing)
        look = summary is not None and "tiles" in self._skips
        reach = self._technique.reach(gbuffer)
        known = self._opener.find(gbuffer, tiles if look else None, reach)
        self.pays = layers is not None or self._opener.pays
        if known is not None and known.open == known.total and self._has_one:
            plane = self.runtime.transient.plane(1, self._size, 1.0)
            if isinstance(plane, TransientPlane):
                plane.clear()
            return plane
        return self._technique.run(gbuffer, tiles=known, layers=layers)

    @property
    def params(self) -> OcclusionParams:
        """The technique's parameters; others of the same shape may be set."""
        params: OcclusionParams = self._technique.params
        return params

    @params.setter
    def params(self, params: OcclusionParams) -> None:
        self._technique.params = params

    def learn(self, costs: Mapping[str, float]) -> None:
        """Take from what the passes of a frame took, in ms by name, what a tile takes."""
        self._opener.learn(costs)
