"""
Layers and overscan, and what they fix
======================================

A G-buffer has what the camera sees first. Two things are missing: surfaces behind, and surfaces outside of the
image.

**What to notice.** Without layers, what is behind a thin thing is taken for empty or for solid; the error lies
along silhouettes. Without overscan, it lies along the border. Four layers and a margin of 15 % take away most
of both, at some times the cost. What remains is foliage finer than a pixel.
"""

import matplotlib.pyplot as plt
import numpy as np

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import terrace

place = terrace()
camera = place.camera(320, 240)
radius = 2 * place.ao_radius
rays = gi.truth.ambient_occlusion(place.scene, camera, radius=radius, rays=256).mean

figure, panels = plt.subplots(1, 4, figsize=(14, 3.1), layout="constrained")
panels[0].imshow(rays, cmap="gray", vmin=0, vmax=1)
panels[0].set_title("256 rays a pixel")
for panel, (layers, overscan) in zip(panels[1:], ((1, 0.0), (4, 0.0), (4, 0.15)), strict=True):
    gbuffer = gi.rasterize.gbuffer(place.scene, camera, layers=layers, overscan=overscan)
    ao = gi.bitmask_ao(gbuffer, radius=radius)
    shown = panel.imshow(np.abs(ao - rays), cmap="inferno", vmin=0, vmax=0.4)
    panel.set_title(f"layers={layers}, overscan={overscan}\nRMSE {gi.metrics.rmse(ao, rays):.3f}")
figure.colorbar(shown, ax=panels, shrink=0.85, label="absolute error")
for panel in panels:
    panel.axis("off")
