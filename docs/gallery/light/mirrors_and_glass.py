"""
Mirrors and glass
=================

A room of trimesh boxes: a glossy floor, a metal sphere and a pane of tinted glass.

**What to notice.** Reflections follow rays on the screen, and where these end unseen a coarse volume of
radiance: the wall's colour and the ball's highlight are right, small things are blurred. Reflections have no
reflections of their own, so the ball is pale in the floor. The pane tints what is behind it and does not
refract; it is missing from reflections and casts no tinted shadow. The bright dots are noise of the paths:
light that the ball and floor send on to matt walls, which `render` does not have.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import trimesh

import ssgi_cl as gi

CREATE = trimesh.creation
parts = {
    "floor": CREATE.box((6, 0.1, 6)).apply_translation((0, -0.05, 0)),
    "wall": CREATE.box((6, 3, 0.1)).apply_translation((0, 1.5, -3)),
    "red": CREATE.box((0.1, 3, 6)).apply_translation((-3, 1.5, 0)),
    "ball": CREATE.icosphere(4, 0.6).apply_translation((-0.9, 0.6, -0.9)),
    "cube": CREATE.box((0.8, 0.8, 0.8)).apply_translation((1.0, 0.4, -1.2)),
    "pane": CREATE.box((1.3, 1.4, 0.02)).apply_translation((1.0, 0.7, 0.2)),
}
surfaces = {
    "floor": gi.Material(albedo=(0.25, 0.25, 0.27), specular=(0.35, 0.35, 0.35), gloss=2000),
    "wall": gi.Material(albedo=(0.7, 0.7, 0.68)),
    "red": gi.Material(albedo=(0.65, 0.1, 0.07)),
    "ball": gi.Material(albedo=(0, 0, 0), specular=(0.9, 0.75, 0.45), gloss=3000),
    "cube": gi.Material(albedo=(0.1, 0.3, 0.6)),
    "pane": gi.Material(albedo=(0, 0, 0), alpha=1.0, blends=True, transmission=(0.45, 0.8, 0.6)),
}
for name, part in parts.items():
    part.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name=name))
loaded = gi.rasterize.load_scene(trimesh.Scene(parts))
scene = replace(loaded, materials=tuple(surfaces[material.name] for material in loaded.materials))

camera = gi.Camera.look_at((0.6, 1.5, 4.0), (0, 0.7, -0.8), yfov=0.75, width=400, height=300)
lights = [gi.DirectionalLight((-0.4, -1, -0.55), (5, 4.8, 4.4), angle=0.02), gi.Environment((0.6, 0.7, 0.9))]
frame = gi.render(scene, camera, lights)
reference = gi.truth.radiance(scene, camera, lights, paths=64).mean

figure, panels = plt.subplots(1, 2, figsize=(11, 4.3), layout="constrained")
panels[0].imshow(frame.image)
panels[0].set_title("render")
panels[1].imshow(gi.tonemap(reference, exposure=frame.exposure))
panels[1].set_title("64 paths a pixel")
for panel in panels:
    panel.axis("off")
