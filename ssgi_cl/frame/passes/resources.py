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
SKY_MAPS, SKY_LIGHT, OCCUPANCY = "depth maps of the sky", "irradiance by environments", "what blocks rays"
HISTORY, SURFEL_HISTORY, CROPS = "earlier frames", "surfels of earlier frames", "crops of earlier shadow maps"
STEADY_AO, STEADY_DIRECT = "ambient occlusion over frames", "direct irradiance over frames"
STEADY_SKY, STEADY_INDIRECT = "irradiance by environments over frames", "indirect irradiance over frames"
LEVELS = "levels of the gather"
MATT, LOBE_LIGHT, GLOSSY = "radiance of matt surfaces", "light that lobes mirror", "radiance with reflections"
SMOOTH = "radiance with smooth edges"
RADIANCE, PIXELS, EXPOSURE, IMAGE = "radiance", "radiance on the host", "exposure", "image"
STEADY = {AO: STEADY_AO, DIRECT: STEADY_DIRECT, SKY_LIGHT: STEADY_SKY, INDIRECT: STEADY_INDIRECT}
"""What has the mean over frames of each kind of light, where there is a history."""
