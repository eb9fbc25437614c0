"""
A sequence of frames
====================

`map_frames` calls a function for each file of a sequence and writes the results beside them. Frames are read
ahead, a failing one stops no other, and what is done is not done again.

**What to notice.** The second call does nothing: results carry the hash of what they were made of. The third
has another radius, so all are made anew. Frames are independent of each other; the pattern of the noise is the
same in each, so that still parts do not flicker.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import OpenEXR

import ssgi_cl as gi
from ssgi_cl.rasterize.scenes import workshop


def ambient_occlusion(path, *, radius):
    return {"ao": gi.gtao(gi.GBuffer.from_exr(path), radius=radius)}


place = workshop()
with tempfile.TemporaryDirectory() as folder:
    shots = [Path(folder) / f"shot.{number:04d}.exr" for number in range(1, 5)]
    for step, shot in enumerate(shots):
        eye = (place.eye[0] - 0.3 * step, place.eye[1], place.eye[2])
        camera = gi.Camera.look_at(eye, place.target, yfov=place.yfov, width=240, height=180)
        gi.rasterize.gbuffer(place.scene, camera).save(shot)

    for radius in (0.15, 0.15, 0.3):
        results = gi.map_frames(
            ambient_occlusion, shots, str(Path(folder) / "ao.####.exr"), arguments={"radius": radius}
        )
        print(f"radius {radius}: {results}")
    done = [str(result.output) for result in results]
    images = [OpenEXR.File(name).channels()["ao"].pixels for name in done]

figure, panels = plt.subplots(1, 4, figsize=(13, 2.7), layout="constrained")
for panel, image, shot in zip(panels, images, shots, strict=True):
    panel.imshow(image, cmap="gray", vmin=0, vmax=1)
    panel.set_title(shot.name.replace("shot", "ao"))
    panel.axis("off")
