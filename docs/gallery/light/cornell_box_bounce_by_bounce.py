"""
The Cornell box, bounce by bounce
=================================

``bounces`` limits how often light is reflected on its way to the pixel. 0 is direct light alone.

**What to notice.** The ceiling is black until light is reflected once. The first bounce carries the colour of
the walls; later ones brighten and mix. Each adds about half of the one before, as reflectances are about .5 on
average, so that six bounces hold all but a percent or two. Direct light ends at the rim of the spot light's
cone. With one bounce the ceiling next to the light shows the cells of the occupancy grid; later bounces hide
it.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import cornell_box

box = cornell_box()
camera = box.camera(256, 256)
dark = tuple(replace(material, emission=(0, 0, 0)) for material in box.scene.materials)
scene = replace(box.scene, materials=dark)  # its spot light stands for the quad that emits

counts = [0, 1, 2, 4, "all"]
light = {n: gi.render(scene, camera, box.lights, bounces=n, ao=False).radiance for n in counts}
before = 0
for n, radiance in light.items():
    mean = float(np.mean(radiance))
    print(f"bounces={n}: mean radiance {mean:.4f} W m^-2 sr^-1, {mean - before:+.4f}")
    before = mean

figure, panels = plt.subplots(1, 5, figsize=(14, 3.2), layout="constrained")
for panel, (n, radiance) in zip(panels, light.items(), strict=True):
    panel.imshow(gi.tonemap(radiance, exposure=1.2))
    panel.set_title(f"bounces={n!r}")
    panel.axis("off")
