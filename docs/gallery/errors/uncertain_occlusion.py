"""
Where ambient occlusion is uncertain
====================================

Without a mesh there is no reference. The spread between techniques that assume different things of what is not
seen tells where not to trust the result: GTAO takes all behind an occluder for solid, the bitmask takes
occluders for thin.

**What to notice.** The spread is large where the true error is: along silhouettes of thin things and below
them. It does not see errors that both share, such as surfaces outside of the image, so it is a lower bound.
"""

from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import hall

room = hall()
camera = room.camera(320, 240)
gbuffer = gi.rasterize.gbuffer(room.scene, camera)
several = np.stack(
    [
        gi.gtao(gbuffer, radius=room.ao_radius, slices=4),
        gi.bitmask_ao(gbuffer, radius=room.ao_radius, slices=4, thickness=0.05),
        gi.bitmask_ao(gbuffer, radius=room.ao_radius, slices=4, thickness=1.0),
    ]
)
spread, mean = np.ptp(several, axis=0), several.mean(axis=0)
rays = gi.truth.ambient_occlusion(room.scene, camera, radius=room.ao_radius, rays=256).mean
error = np.abs(mean - rays)

edges = np.quantile(spread, [0, 0.5, 0.75, 0.9, 0.95, 1])
for low, high in pairwise(edges):
    inside = (spread >= low) & (spread <= high)
    print(f"spread {low:.2f} to {high:.2f}: mean error {error[inside].mean():.3f}")

figure, panels = plt.subplots(1, 3, figsize=(12, 3.3), layout="constrained")
panels[0].imshow(mean, cmap="gray", vmin=0, vmax=1)
panels[1].imshow(spread, cmap="inferno", vmin=0, vmax=0.5)
panels[2].imshow(error, cmap="inferno", vmin=0, vmax=0.5)
for panel, title in zip(
    panels, ("mean of three estimates", "their spread", "true error, 256 rays a pixel"), strict=True
):
    panel.set_title(title)
    panel.axis("off")
