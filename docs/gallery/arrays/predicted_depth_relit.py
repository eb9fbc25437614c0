"""
Predicted depth, lit and relit
==============================

A network for relative depth (MiDaS, Depth Anything) gives 1 / depth up to a scale and a shift. The prediction
is imitated here: the depth of a built-in room, inverted, normalised and smoothed; the photograph is a render of
the room.

**What to notice.** The relief shows at a glance whether scale, shift and field of view are sensible: walls have
to be flat and corners square. The new lamp hangs at the upper left and casts shadows, though only surfaces of
the photograph can cast any. Without an albedo the photograph is taken for paint, so its old shadows stay below
the table. Silhouettes have dark rims: a prediction is smooth across them, which makes steep walls between
object and background.
"""

import matplotlib.pyplot as plt
from scipy.ndimage import gaussian_filter

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import parlour

room = parlour()
camera = room.camera(320, 240)
frame = gi.render(room.scene, camera, room.lights, preset="low", gbuffer=True)
inverse = 1 / frame.gbuffer.depth
predicted = (inverse - inverse.min()) / (inverse.max() - inverse.min())
predicted = gaussian_filter(predicted, 0.7)

# %%
# Scale and shift come from two distances that are known, here of the nearest and the farthest surface.
known = {"scale": inverse.max() - inverse.min(), "shift": inverse.min()}
gbuffer = gi.GBuffer.from_depth(predicted, kind="relative", yfov=room.yfov, **known)
relief = gi.shade_depth(predicted, kind="relative", yfov=room.yfov, **known)
lamp = gi.PointLight((-0.9, 0.7, -1.6), (5.0, 4.0, 2.6))  # camera space, W/sr
relit = gi.relight(gbuffer, frame.radiance, [lamp, gi.Environment(0.1)], replaced=True)

figure, panels = plt.subplots(1, 3, figsize=(12, 3.3), layout="constrained")
shown = {"photograph": frame.image, "its depth as a relief": relief, "lit by another lamp": gi.tonemap(relit)}
for panel, (title, image) in zip(panels, shown.items(), strict=True):
    panel.imshow(image)
    panel.set_title(title)
    panel.axis("off")
