"""Names of the resources that passes of a frame read and write."""

from __future__ import annotations

SCENE, CAMERA, LIGHTS, MULTI_BOUNCE = "scene", "camera", "lights", "multi_bounce"
CASTING = "surfaces that light meets"
SKY = "lights as the background shows them"
AO_PARAMS, INDIRECT_PARAMS = "parameters of occlusion", "parameters of indirect light"
GBUFFER = "G-buffer"
AO, DIRECT, INDIRECT = "ambient occlusion", "direct irradiance", "indirect irradiance"
PUNCTUAL = "irradiance by punctual lights"
SHADOWS, RSM = "shadow maps", "reflective shadow map"
SURFELS, LIGHT_VOLUME, EVEN_LIGHT = "light of surfels", "light volume", "even light"
SKY_LIGHT, OCCUPANCY = "irradiance by environments", "what blocks rays"
LEVELS = "levels of the gather"
MATT, LOBE_LIGHT, GLOSSY = "radiance of matt surfaces", "light that lobes mirror", "radiance with reflections"
SMOOTH = "radiance with smooth edges"
RADIANCE, PIXELS, EXPOSURE, IMAGE = "radiance", "radiance on the host", "exposure", "image"
