"""Splatting by cutoff and multiresolution splatting against all lights at all pixels, by work."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.bench.cases.multires_splat import all_lights, relative_rmse
from ssgi_cl.bench.cases.vpl_splat import MAP_SIZE, lit
from ssgi_cl.bench.drawn import DrawnMaps
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.techniques.multires import multires_grid
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.vpl import vpl_splat
from ssgi_cl.techniques.vpl.tile_boxes import TILE
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams
from ssgi_cl.techniques.vpl.vpl_tree import GROUP, VplTree
from ssgi_cl.tuning.context import Context

from .scan import Measured, Scan, parted, replaced

LIGHTS = 1024
"""By default, as the techniques have it."""
SPLAT_CONSTANTS = ("coarser",)
GRID_CONSTANTS = ("begins", "ends", "no_second_difference", "beyond", "coarse_bound", "bound_power")
"""Constants that no parameter sets, of the modules vpl_splat and multires_grid."""


class CountedTree:
    """A tree of lights that counts what it is asked for.

    Args:
        tree: the tree.

    Attributes:
        pairs: of a point and a light or a cluster of lights, evaluated so far.
    """

    def __init__(self, tree: VplTree) -> None:
        self._tree = tree
        self.pairs = 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._tree, name)

    def shine(self, source: Any, samples: DeviceArray, *args: Any, **values: Any) -> None:
        """Do as the tree does, and count."""
        self._tree.shine(source, samples, *args, **values)
        groups = -(-int(samples.download()[0]) // GROUP)
        self.pairs += GROUP * sum(len(each) for each in self._tree.cuts(groups))


def splat_errors(context: Context, values: Mapping[str, Any]) -> Measured:
    """Return RMSE in percent of the mean irradiance, and pairs of a pixel and a light per pixel.

    Lights don't give way to their parts (`refine` 0), so that both sides have the same lights.

    Args:
        context: the scene; its punctual lights make the reflective shadow maps.
        values: parameters of `VplSplatParams`, and `coarser`, lights that one stands for where
            what the cutoff leaves out is put back.
    """
    constants, given = parted(values, SPLAT_CONSTANTS)
    params = VplSplatParams(**{"vpls": LIGHTS, "refine": 0.0, **given})
    maps = _maps(context)

    def shone(restore: bool) -> tuple[NDArray[np.float32], float]:
        own = VplSplatParams(**{"vpls": LIGHTS, "refine": 0.0, **given, "restore": restore})
        with replaced(vpl_splat, constants):
            technique = VplSplat(context.runtime, context.size, own)
        image = lit(context, maps, lambda rsms: technique.run(context.gbuffer, rsms=rsms))
        return image, _per_pixel(technique, context)

    image, pairs = shone(False)
    if params.restore and params.cutoff > 0.0:
        image, more = shone(True)  # lists are of the latest pass: the lights that put back
        pairs += more
    return Measured(relative_rmse(image - _every(context, maps), _every(context, maps)), pairs)


def multires_errors(context: Context, values: Mapping[str, Any]) -> Measured:
    """Return RMSE in percent of the mean irradiance, and pairs of a point and a light per pixel.

    Args:
        context: as in `splat_errors`.
        values: parameters of `MultiresSplatParams` and constants of multires_grid in
            `GRID_CONSTANTS`.
    """
    constants, given = parted(values, GRID_CONSTANTS)
    maps = _maps(context)
    technique = MultiresSplat(
        context.runtime, context.size, MultiresSplatParams(**{"vpls": LIGHTS, "refine": 0.0, **given})
    )
    counted = CountedTree(technique.tree)
    technique.tree = cast(VplTree, counted)

    def shine(rsms: Sequence[DeviceRsm]) -> Plane:
        return technique.run(context.gbuffer, rsms=rsms)

    with replaced(multires_grid, constants):
        image = lit(context, maps, shine)
    pairs = counted.pairs / (context.size[0] * context.size[1])
    return Measured(relative_rmse(image - _every(context, maps), _every(context, maps)), pairs)


def _maps(context: Context) -> DrawnMaps:
    return context.shared("light maps", lambda: DrawnMaps(context, MAP_SIZE))


def _every(context: Context, maps: DrawnMaps) -> NDArray[np.float32]:
    return context.shared("all lights", lambda: all_lights(context, maps, LIGHTS, refine=0.0))


def _per_pixel(technique: VplSplat, context: Context) -> float:
    """Return how many lights a pixel looked at in the latest pass, on average."""
    rows, columns = context.size
    pairs = 0
    for (row, column, _), lights in np.ndenumerate(technique.lists()):
        high, wide = min(TILE, rows - row * TILE), min(TILE, columns - column * TILE)
        pairs += high * wide * len(lights)
    return pairs / (rows * columns)


SCANS: Mapping[str, Scan] = {
    name: Scan(measure, "RMSE (% of the mean)", "lights looked at per pixel")
    for name, measure in (("vpl_splat", splat_errors), ("multires_splat", multires_errors))
}
