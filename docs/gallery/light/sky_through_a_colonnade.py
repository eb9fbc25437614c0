"""
An HDR sky through a colonnade
==============================

A latitude-longitude sky with a sun lights a generated colonnade. `Environment.load` reads such a sky from an
.exr or .hdr file; here one of 128 x 256 texels is computed, so that the script needs no file.

**What to notice.** The sun's few texels hold most of the light. A whole frame takes them out of the sky and
draws a shadow map for them. With sky alone there are no hard shadows, and columns dim what is behind them at
any distance, not within a radius only.
"""

import matplotlib.pyplot as plt
import numpy as np

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import make_scene

place = make_scene("colonnade-2")
camera = place.camera(320, 240)

rows, columns = 128, 256
elevation = np.pi * (0.5 - (np.arange(rows) + 0.5) / rows)[:, None, None]
sky = np.where(elevation > 0, 0.5 + 0.7 * np.exp(-3 * np.maximum(elevation, 0)), 0.15)
sky = np.broadcast_to(sky * np.array([0.75, 0.95, 1.25]), (rows, columns, 3)).copy()
overcast = gi.Environment(sky)
x, y, z = -place.lights[0].direction / np.linalg.norm(place.lights[0].direction)  # towards the sun
row, column = rows * (0.5 - np.arcsin(y) / np.pi), columns * (0.5 + np.arctan2(x, -z) / (2 * np.pi))
sky[int(row) : int(row) + 2, int(column) : int(column) + 2] += np.array([7800.0, 6900.0, 5200.0])
sunny = gi.Environment(sky)

frames = {name: gi.render(place.scene, camera, [env]) for name, env in (("sky", overcast), ("sky and sun", sunny))}
print(gi.split_suns(sunny)[0])

figure, panels = plt.subplots(1, 3, figsize=(13, 3.3), layout="constrained")
panels[0].imshow(gi.tonemap(np.float32(sky), exposure=0.4))
panels[0].set_title("the sky, latitude-longitude")
for panel, (name, frame) in zip(panels[1:], frames.items(), strict=True):
    panel.imshow(frame.image)
    panel.set_title(name)
for panel in panels:
    panel.axis("off")
