"""Blocks of shadow maps: planes that bound the depths of each, in place of a filter's taps."""

from __future__ import annotations

from collections.abc import Sequence

from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.constants import SHADOW_BLOCK_BITS, SHADOW_IMAGES
from ssgi_cl.device.runtime import Runtime

BLOCK = 1 << SHADOW_BLOCK_BITS
"""Texels along a block's side."""


class ShadowBlocks:
    """Passes that bound the blocks of shadow maps of one size."""

    def __init__(self, runtime: Runtime, size: int) -> None:
        self.runtime = runtime
        self.size: Size = (-(-size // BLOCK), -(-size // BLOCK))
        self._kernel = runtime.kernel("direct/shadow_blocks.cl")

    def plane(self, faces: int) -> Plane:
        """Return memory for the blocks of a map of so many faces."""
        return self.runtime.plane(SHADOW_IMAGES * faces, self.size)

    def find(self, depth: Plane, blocks: Plane, images: Sequence[int], *, perspective: bool) -> None:
        """Queue the passes.

        Args:
            depth: as the light sees it.
            blocks: what `plane` returned, is written.
            images: of `depth`, in ascending order, that are looked at.
            perspective: of the light's cameras; else they are orthographic.
        """
        rows, columns = self.size
        start = 0
        for place in range(1, len(images) + 1):
            if place < len(images) and images[place] == images[place - 1] + 1:
                continue
            count = place - start
            self._kernel.run(
                depth.size,
                grid=(count * rows, columns),
                map=depth,
                blocks=blocks,
                count=(rows, columns),
                first=images[start],
                faces=count,
                perspective=float(perspective),
            )
            start = place
