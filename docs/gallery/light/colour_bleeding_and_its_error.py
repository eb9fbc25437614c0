"""
Colour bleeding, and its error
==============================

One-bounce irradiance of the Cornell box by virtual point lights, beside 256 paths a pixel.

**What to notice.** The red and green walls tint floor and blocks. The error has a place: contacts of blocks,
floor and walls are too dark (magenta), since the occupancy grid that blocks light is coarser than the gap. The
dots above are noise of the reference, about half of the RMSE; its standard error is known and is printed.
"""

import matplotlib.pyplot as plt
import numpy as np

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import cornell_box

box = cornell_box()
camera = box.camera(240, 240)
gbuffer = gi.rasterize.gbuffer(box.scene, camera)
maps = gi.shadow_maps(box.scene, box.lights, size=256)
bounce = gi.multires_splat(gbuffer, maps, visibility=True, scene=box.scene)
reference = gi.truth.one_bounce(box.scene, camera, box.lights, paths=256)

error = (bounce - reference.mean).mean(axis=-1)
rmse = gi.metrics.rmse(bounce, reference.mean) / float(reference.mean.mean())
print(f"RMSE {rmse:.1%} of the mean, bias {float(np.mean(error)) / float(reference.mean.mean()):+.1%}")
print(f"standard error of the reference {float(np.mean(reference.error)) / float(reference.mean.mean()):.1%}")

figure, panels = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
for panel, image, title in ((panels[0], bounce, "multires_splat"), (panels[1], reference.mean, "256 paths a pixel")):
    panel.imshow(gi.tonemap(np.float32(image), exposure=0.5))
    panel.set_title(title)
limit = float(np.quantile(np.abs(error), 0.99))
shown = panels[2].imshow(error, cmap="PiYG", vmin=-limit, vmax=limit)
figure.colorbar(shown, ax=panels[2], shrink=0.85, label="W/m^2")
panels[2].set_title(f"difference: RMSE {rmse:.0%} of the mean")
for panel in panels:
    panel.axis("off")
