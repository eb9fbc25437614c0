"""Bounds of the surfaces that an image shows, tile by tile."""

from __future__ import annotations

from ssgi_cl.device.arrays import DeviceArray, Size
from ssgi_cl.device.constants import VPL_BOX, VPL_TILE
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA
from ssgi_cl.techniques.vpl.packed_vpls import VPL, DeviceVpls, packed_params
from ssgi_cl.techniques.vpl.vpl_tree import Samples

TILE, BOX = VPL_TILE, VPL_BOX


def tiles_of(size: Size) -> Size:
    """Return (rows, columns) of the tiles of an image."""
    return (-(-size[0] // TILE), -(-size[1] // TILE))


def bound_tiles(runtime: Runtime, source: Samples, boxes: DeviceArray, lights: DeviceVpls) -> int:
    """Queue the pass that bounds the surfaces of each tile; return the number of tiles.

    Args:
        runtime: the device.
        source: the surfaces.
        boxes: of `BOX` floats a tile, which are written.
        lights: in whose unit lengths are counted.
    """
    tiles = tiles_of(source.size)
    runtime.kernel("vpl/vpl_boxes.cl", structs=(CAMERA, VPL)).run(
        source.size,
        grid=tiles,
        depth=source.depth,
        normal=source.normal,
        boxes=boxes,
        camera=source.camera_struct,
        params=packed_params(lights.values, source.margin),
    )
    return tiles[0] * tiles[1]
