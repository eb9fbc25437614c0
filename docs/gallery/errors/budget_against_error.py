"""
Budget against error
====================

Every ambient occlusion technique takes `preset`, `error` or `budget_ms` in place of sample counts. Here all
presets of three techniques are held to 256 rays a pixel.

**What to notice.** Each curve flattens: beyond a few milliseconds more samples gain nothing, since what remains
is what one depth layer does not show. `bitmask_ao` costs more per sample and gains from layers, see
:doc:`layers_and_overscan`. Times are those of this machine.
"""

import time

import matplotlib.pyplot as plt

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import hall

room = hall()
camera = room.camera(320, 240)
gbuffer = gi.rasterize.gbuffer(room.scene, camera)
rays = gi.truth.ambient_occlusion(room.scene, camera, radius=room.ao_radius, rays=256).mean

figure, panel = plt.subplots(figsize=(7, 4.2), layout="constrained")
for technique in (gi.ssao, gi.gtao, gi.bitmask_ao):
    spent, errors = [], []
    for preset in ("low", "medium", "high", "ultra"):
        technique(gbuffer, radius=room.ao_radius, preset=preset)
        runs = []
        for _ in range(7):
            began = time.perf_counter()
            ao = technique(gbuffer, radius=room.ao_radius, preset=preset)
            runs.append(1e3 * (time.perf_counter() - began))
        spent.append(min(runs))
        errors.append(gi.metrics.rmse(ao, rays))
    panel.plot(spent, errors, "o-", label=technique.__name__)
panel.set(xscale="log", xlabel="ms for 320 x 240 pixels", ylabel="RMSE against 256 rays a pixel", ylim=(0, None))
panel.xaxis.set_major_formatter("{x:g}")
panel.xaxis.set_minor_formatter("{x:g}")
panel.legend()

print(gi.choose("gtao", gbuffer.size, error=0.1).params)  # the fastest setting expected to err less
