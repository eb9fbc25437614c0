"""
A depth camera's frame, cleaned
===============================

Depth cameras measure with a noise that grows with the square of the distance, and leave holes at edges. Both
are put on the depth of a built-in room here: 0.15 % of the square of the distance in metres, and 2 % of the
pixels missing.

**What to notice.** Noise of a few millimetres is enough to make ambient occlusion useless, since it reads as
roughness. `clean_depth` fits planes to inverse depth, so that edges stay where they are. Steps lower than the
noise, far behind the arch, are gone for good.
"""

import matplotlib.pyplot as plt
import numpy as np

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import parlour

room = parlour()
camera = room.camera(320, 240)
exact = gi.rasterize.gbuffer(room.scene, camera).depth
rng = np.random.default_rng(1)
measured = exact + 0.0015 * exact**2 * rng.normal(size=exact.shape)
measured[rng.random(exact.shape) < 0.02] = 0

cleaned = gi.clean_depth(measured)
views = {"exact": exact, "measured": measured, "cleaned": cleaned}
ao = {name: gi.gtao(gi.GBuffer.from_depth(depth, yfov=room.yfov), radius=0.5) for name, depth in views.items()}

figure, panels = plt.subplots(1, 3, figsize=(12, 3.4), layout="constrained")
for panel, (name, image) in zip(panels, ao.items(), strict=True):
    panel.imshow(image, cmap="gray", vmin=0, vmax=1)
    panel.set_title(f"{name}: RMSE {gi.metrics.rmse(image, ao['exact']):.3f}")
    panel.axis("off")
