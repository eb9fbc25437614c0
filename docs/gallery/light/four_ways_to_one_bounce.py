"""
Four ways to one bounce
=======================

The same light by four techniques. They differ in what they need: `ssdo` works on the G-buffer alone, the others
need a reflective shadow map of each light, and two of them the scene to block light.

**What to notice.** `rsm_gather` has no visibility, so light passes through the blocks. `ssdo` misses what the
camera does not see: the back of the blocks and the wall behind the viewer. Times are of a second call and
change with the machine.
"""

import time

import matplotlib.pyplot as plt
import numpy as np

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import cornell_box

box = cornell_box()
camera = box.camera(240, 240)
gbuffer = gi.rasterize.gbuffer(box.scene, camera)
maps = gi.shadow_maps(box.scene, box.lights, size=256)
ways = {
    "rsm_gather": lambda: gi.rsm_gather(gbuffer, maps),
    "vpl_splat": lambda: gi.vpl_splat(gbuffer, maps, visibility=True, interleave=True, scene=box.scene),
    "multires_splat": lambda: gi.multires_splat(gbuffer, maps, visibility=True, scene=box.scene),
    "ssdo": lambda: gi.ssdo(gbuffer, box.lights, radius=0.6, shadow_maps=maps, emission=False)[1],
}
reference = gi.truth.one_bounce(box.scene, camera, box.lights, paths=256).mean

figure, panels = plt.subplots(1, 5, figsize=(14, 3.3), layout="constrained")
for panel, (name, way) in zip(panels, ways.items(), strict=False):
    way()  # compiles its kernels
    began = time.perf_counter()
    bounce = way()
    ms = 1e3 * (time.perf_counter() - began)
    rmse = gi.metrics.rmse(bounce, reference) / float(reference.mean())
    panel.imshow(gi.tonemap(bounce, exposure=0.5))
    panel.set_title(f"{name}\n{ms:.0f} ms, RMSE {rmse:.0%}")
panels[4].imshow(gi.tonemap(np.float32(reference), exposure=0.5))
panels[4].set_title("256 paths\n")
for panel in panels:
    panel.axis("off")
