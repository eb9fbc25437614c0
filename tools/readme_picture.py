"""The picture of README: `python -m tools.readme_picture`.

The default frame of the built-in hall beside its path-traced reference, with one exposure; it prints
the error of the frame.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

import ssgi_cl as gi
from ssgi_cl.bench.errors import picture_flip
from ssgi_cl.rasterize.scenes import hall

TARGET = Path(__file__).parents[1] / "docs/hall.jpg"
WIDTH, HEIGHT = 600, 450
PATHS = 256


def main() -> None:
    """Render both, write the picture, print FLIP and the bias of the mean."""
    room = hall()
    camera = room.camera(WIDTH, HEIGHT)
    frame = gi.render(room.scene, camera, room.lights)
    reference = gi.truth.radiance(room.scene, camera, room.lights, paths=PATHS).mean
    panels = [gi.tonemap(np.float32(light), exposure=frame.exposure) for light in (frame.radiance, reference)]
    bias = np.mean(frame.radiance, dtype=np.float64) / np.mean(reference, dtype=np.float64) - 1.0
    flip = picture_flip(frame.radiance, reference)
    print(f"FLIP {flip:.3f}, mean {100.0 * bias:+.1f} %, {PATHS} paths, {WIDTH} x {HEIGHT}")
    gap = np.full((HEIGHT, 8, 3), 255, np.uint8)
    Image.fromarray(np.concatenate([panels[0], gap, panels[1]], axis=1)).save(TARGET, quality=88)


if __name__ == "__main__":
    main()
