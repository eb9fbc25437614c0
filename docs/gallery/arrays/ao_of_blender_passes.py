"""
Ambient occlusion of Blender's passes
=====================================

Blender writes depth and normals of a render into one EXR file when *Depth* and *Normal* are switched on under
View Layer > Passes. Such a file is made first, so that the script runs without Blender: its normals are in
Blender's world, with z up, and depth is 1e10 where nothing is.

**What to notice.** Neither the channels nor the space of the normals is said; ``notes`` tells what was found.
The camera is said, as Blender writes none into the file. Edges stay sharp, since normals of the file are used.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import OpenEXR

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import terrace

place = terrace()
camera = place.camera(320, 240)
drawn = gi.rasterize.gbuffer(place.scene, camera)
x, y, z = np.moveaxis(drawn.normal, -1, 0)
channels = {"ViewLayer.Depth.Z": np.where(np.isinf(drawn.depth), np.float32(1e10), drawn.depth)}
channels |= dict(zip([f"ViewLayer.Normal.{axis}" for axis in "XYZ"], [x, -z, y], strict=True))

# %%
# From here on it is what one does with a file of one's own.
with tempfile.TemporaryDirectory() as folder:
    shot = str(Path(folder) / "shot.exr")
    OpenEXR.File({}, {name: np.ascontiguousarray(plane) for name, plane in channels.items()}).write(shot)
    gbuffer = gi.GBuffer.from_exr(shot, camera=camera)
print("\n".join(gbuffer.notes))
ao = gi.gtao(gbuffer, radius=place.ao_radius)

figure, panels = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
panels[0].imshow(1 / gbuffer.depth, cmap="viridis")
panels[0].set_title("1 / depth")
panels[1].imshow(ao, cmap="gray", vmin=0, vmax=1)
panels[1].set_title("ambient occlusion, radius 0.5 m")
for panel in panels:
    panel.axis("off")
