"""
The sky-view factor of an elevation model
=========================================

The share of the sky that each point of a terrain sees decides how fast it cools and how much diffuse light it
gets. It is cosine-weighted ambient occlusion of the terrain seen from above, with a horizontal receiver.

**What to notice.** `orthographic` is the height of the map in metres, so the radius is in metres too. Valley
floors and the foot of cliffs see less. The pit on the plateau, 40 m deep and 240 m wide, has a known answer in
its middle: the form factor of its square opening, 0.917. The map sees nothing beyond its border, so that the
border sees too much sky.
"""

import matplotlib.pyplot as plt
import numpy as np

import ssgi_cl as gi

CELL = 4.0  # metres
y, x = CELL * np.mgrid[:240, :320]
heights = 60 * np.sin(x / 190) * np.cos(y / 160) + 18 * np.sin(x / 47 + 1) * np.sin(y / 61) + 5 * np.sin(x / 17)
aside = np.maximum(np.abs(x - 898), np.abs(y - 518))  # of the middle of a plateau with a pit in it
heights = np.where(aside < 120, -10, np.where(aside < 260, 30, heights))

up = np.broadcast_to((0.0, 0.0, 1.0), (*heights.shape, 3))
seen = gi.GBuffer.from_depth(
    heights.max() + 1 - heights, orthographic=CELL * len(heights), normal=up, normal_space="camera"
)
sky_view = gi.gtao(seen, radius=400.0, slices=8, taps=32)
print(f"in the middle of the pit: {sky_view[129, 224]:.3f}")

figure, panels = plt.subplots(1, 2, figsize=(11, 3.9), layout="constrained")
for panel, image, title, cmap in (
    (panels[0], heights, "elevation, m", "terrain"),
    (panels[1], sky_view, "sky-view factor", "magma"),
):
    shown = panel.imshow(image, cmap=cmap, extent=(0, x.max(), y.max(), 0))
    figure.colorbar(shown, ax=panel, shrink=0.85)
    panel.set_title(title)
    panel.set_xlabel("m")
