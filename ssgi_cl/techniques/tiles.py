"""Bounds of tiles of 16 x 16 pixels, by which passes skip work: depth, normals, planes.

Nothing is guessed: a tile is open only if ambient occlusion is proven to be exactly 1 in it, and a
light is left out only if it is proven to light none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.active_region import PreviousRegion
from ssgi_cl.device.arrays import DeviceArray, Plane, Size
from ssgi_cl.device.constants import (
    TILES_COUNT,
    TILES_FARTHEST,
    TILES_GREATEST,
    TILES_IS_FAR,
    TILES_IS_FLAT,
    TILES_IS_OPEN,
    TILES_LAYER,
    TILES_LEAST,
    TILES_NEAREST,
    TILES_OFFSET,
    TILES_SIDE,
)
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats
from ssgi_cl.techniques.shading.light_reach import Boxes

TILE = TILES_SIDE
SUMMARY = TILES_COUNT

TILES = Struct(
    "TileParams",
    (
        *floats("reach_px", "far_px", "more_px", "most_px", "bulge", "slack", "perspective"),
        *floats("beyond", "beyond_px", "to_x", "to_y", "at_x", "at_y"),
        *((n, "int") for n in ("group", "lead_columns", "lead_rows", "columns", "rows")),
    ),
)


@dataclass(frozen=True, kw_only=True)
class Reach:
    """How far a technique of ambient occlusion looks.

    Attributes:
        radius: scene units.
        stretch: distance in the image up to which it looks, over that of the radius there.
        more_px: pixels of the full size that come on top.
        most_px: limit of the projected radius, pixels of the full size.
        step: pixels from one that is computed to the next.
        group: pixels of a row that look as far as the nearest of them, of the full size.
        bulge: 1 if what lies before the receiver is projected from there, else 0.
        slack: part of the bias against roundings that a proof may use up, relative to depth.
        beyond, beyond_px: how far surfaces are taken to go on beyond a pixel, in parts of that
            distance and in pixels of the full size on top; see `pieces` of `Tiles`.
    """

    radius: float
    stretch: float = 1.0
    more_px: float = 2.0
    most_px: float = math.inf
    step: int = 1
    group: int = TILE
    bulge: float = 0.0
    slack: float = 2e-6
    beyond: float = 0.0
    beyond_px: float = 0.0


@dataclass(frozen=True, eq=False)
class OpenTiles:
    """Tiles of an image in which ambient occlusion is exactly 1.

    Attributes:
        bits: on the device, see kernels/tiles/open.clh.
        columns: of tiles.
        total, empty, far, flat: tiles in all, and open ones by reason: nothing is there; the radius
            covers less than a pixel; nothing within reach rises above the tangent planes.
    """

    bits: DeviceArray
    columns: int
    total: int
    empty: int
    far: int
    flat: int

    @property
    def open(self) -> int:
        """Number of tiles that are open."""
        return self.empty + self.far + self.flat

    @property
    def why(self) -> str:
        """The reasons in words."""
        counts = {"empty": self.empty, "too far": self.far, "flat": self.flat}
        reasons = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
        return f"{self.open} of {self.total} tiles are open ({reasons})"


def tile_values(tiles: OpenTiles | None, step: int) -> dict[str, int]:
    """Return the members of a struct that tell a kernel about tiles, of a result with every
    `step`-th pixel of their image."""
    return {"tile_columns": 0 if tiles is None else tiles.columns, "tile_step": step}


@dataclass(frozen=True, eq=False)
class TileSummary:
    """What is known of the tiles that show anything, on the host.

    Attributes:
        boxes: round what each tile holds; planes of flat tiles alone.
        layers: of depth, that have any pixel.
    """

    boxes: Boxes
    layers: int


class Tiles:
    """Looks at the tiles of G-buffers of one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the camera's image.
        margin: (rows, columns) by which the G-buffers exceed it on every side.
        layers: depth layers of the G-buffers.
        pieces: whether tiles are to be open for SSDO's bitmask, whose taps stand for pieces of
            planes, rather than for points in them.
    """

    def __init__(
        self, runtime: Runtime, size: Size, margin: Size = (0, 0), layers: int = 1, *, pieces: bool = False
    ) -> None:
        self.runtime = runtime
        self.margin = margin
        self.size = (-(-size[0] // TILE), -(-size[1] // TILE))
        self._pixels = size
        self._lead = (-(-margin[0] // TILE), -(-margin[1] // TILE))
        whole = (self._lead[0] - (-(size[0] + margin[0]) // TILE), self._lead[1] - (-(size[1] + margin[1]) // TILE))
        self._summary: Plane = runtime.plane(SUMMARY, whole, 0.0)
        self._looked = PreviousRegion()
        self._open, self._interior = (runtime.array(np.zeros(self.size[0] * self.size[1], np.int32)) for _ in range(2))
        own = {"TILES_PIECES": int(pieces)}
        self._look = runtime.kernel("tiles/tiles_summary.cl", {"TILES_LAYERS": layers, **own}, (CAMERA,))
        self._prove = runtime.kernel("tiles/tiles_open.cl", own, (TILES,))
        self._settle = runtime.kernel("tiles/tiles_interior.cl")

    def look(self, gbuffer: DeviceGBuffer) -> TileSummary:
        """Queue the pass that summarizes the tiles, and read it back: 68 bytes a tile."""
        rows, columns = gbuffer.whole
        start = [self.margin[i] - TILE * self._lead[i] for i in (1, 0)]
        with self._looked.over(gbuffer.region) as region:
            if region is not None:
                region = region.inside((rows - start[1], columns - start[0]), (start[1], start[0]))
            self._look.run(
                "tile summary",
                self._summary.size,
                grid=self._summary.size,
                region=region,
                cell=(TILE, TILE),
                linear=gbuffer.linear,
                normal=gbuffer.normal,
                depth=gbuffer.depth,
                summary=self._summary,
                whole=(rows, columns),
                start=start[::-1],
                camera=gbuffer.camera_struct,
            )
        summary = self._summary.download()
        layers = max(int(summary[TILES_LAYER].max(initial=0.0)), 1)
        inner = summary[
            :, self._lead[0] : self._lead[0] + self.size[0], self._lead[1] : self._lead[1] + self.size[1]
        ].astype(np.float64)
        there = inner[TILES_NEAREST] > -math.inf
        boxes = self._boxes(gbuffer.camera_struct, inner[TILES_NEAREST], inner[TILES_FARTHEST], there)
        least, greatest = (inner[first : first + 3, there].T for first in (TILES_LEAST, TILES_GREATEST))
        return TileSummary(Boxes(*boxes, least, greatest, inner[TILES_OFFSET, there]), layers)

    def _boxes(
        self, camera: np.void, nearest: NDArray[np.float64], farthest: NDArray[np.float64], there: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the corners [n, 3] of boxes round what tiles hold, view space."""
        row, column = np.nonzero(there)
        perspective = bool(camera["perspective"])
        v = nearest[there], farthest[there]
        # Farther than float32 has a number for is as good as nowhere; the box is finite then.
        near, far = (1.0 / np.maximum(x, 1e-38) if perspective else -x for x in v)
        least, greatest = np.empty((2, len(row), 3))
        for axis, first, most, name in (
            (0, column * TILE, self._pixels[1], "x"),
            (1, row * TILE, self._pixels[0], "y"),
        ):
            margin = self.margin[1 - axis]
            slopes = [
                float(camera[f"at_{name}"]) + float(camera[f"to_{name}"]) * (pixel + margin)
                for pixel in (first, np.minimum(first + TILE, most))
            ]
            ends = [s * k for s in slopes for k in ((near, far) if perspective else (1.0,))]
            least[:, axis] = np.minimum.reduce(ends)
            greatest[:, axis] = np.maximum.reduce(ends)
        least[:, 2], greatest[:, 2] = -far, -near
        # float32 depths and slopes round.
        room = 1e-6 * np.maximum(np.abs(least), np.abs(greatest)).max(axis=1, keepdims=True)
        return least - room, greatest + room

    def open(self, gbuffer: DeviceGBuffer, reach: Reach) -> OpenTiles:
        """Queue the passes that find the open tiles, from the summary of the latest `look`.

        How many there are is read back, 4 bytes a tile.
        """
        camera = gbuffer.camera_struct
        pixels = max(abs(float(camera["from_x"])), abs(float(camera["from_y"])))
        rows, columns = self._summary.size
        most_px = reach.most_px * reach.stretch
        if camera["perspective"]:
            # A radius limited to most_px pixels is that part of `pixels` of the depth.
            most_px /= max(1.0 - reach.bulge * min(reach.most_px / pixels, 1.0), 1e-3)
        slopes: dict[str, float] = {}
        for name, margin in (("x", self.margin[1]), ("y", self.margin[0])):
            to = float(camera[f"to_{name}"])
            slopes |= {f"to_{name}": to, f"at_{name}": float(camera[f"at_{name}"]) + to * margin}
        self._prove.run(
            "tiles open",
            self.size,
            grid=self.size,
            summary=self._summary,
            open=self._open,
            params=TILES.pack(
                {
                    "reach_px": reach.radius * pixels * reach.stretch,
                    "far_px": reach.radius * pixels / reach.step,
                    "more_px": reach.more_px,
                    "most_px": most_px,
                    "bulge": reach.bulge * reach.radius,
                    "slack": reach.slack,
                    **slopes,
                    "beyond": reach.beyond,
                    "beyond_px": reach.beyond_px,
                    "perspective": float(camera["perspective"]),
                    "group": -(-reach.group // TILE),
                    "lead_columns": self._lead[1],
                    "lead_rows": self._lead[0],
                    "columns": columns,
                    "rows": rows,
                }
            ),
        )
        self._settle.run("tiles interior", self.size, grid=self.size, open=self._open, interior=self._interior)
        bits = self._interior.download()
        opened, far, flat = (int(np.count_nonzero(bits & bit)) for bit in (TILES_IS_OPEN, TILES_IS_FAR, TILES_IS_FLAT))
        return OpenTiles(self._interior, self.size[1], bits.size, opened - far - flat, far, flat)
