"""Constants that the host and the kernels share: each is declared here, and nowhere else.

A kernel whose text has the name of one gets its definition, see `definitions`; the text itself has
an #error for the case that it is missing.
"""

from __future__ import annotations

import re

from ssgi_cl.core.bvh import BINS, DEEPEST, LEAF
from ssgi_cl.core.environment_samples import POINTS
from ssgi_cl.core.hemisphere import TILE
from ssgi_cl.core.history import Reset
from ssgi_cl.core.vpls import SHARPEST
from ssgi_cl.core.wide_bvh import WAITING

SSGI_GUARD = 16
"""Floats between the rows of a plane: a load may reach so far past either end of a row."""
SSGI_GROUP = 64
"""Work-items of a work-group: every device takes so many, and kernels have so many that share local memory."""

SLICES_GROUP = 16
"""Pixels that scan together, every fourth of a row."""
SLICES_STRIP = 256
"""Columns that are scanned from top to bottom, before those to the right of them."""
SLICES_SIMILAR = 0.4
"""Those whose 1 / depth is at least this part of the nearest's share its slices."""
SLICES_NEAREST_TAP = 1.3
"""Distance of the nearest tap, px: at any angle it lies in another pixel than the receiver."""
SLICES_LEAST_N_DOT_V = 0.05
"""Cosine between normal and view ray that a grazing or averted normal is taken to have."""

SSAO_TILE = 8
"""Rows and columns after which the points of SSAO repeat."""

SEEN_SIDE = 32
"""Pixels along the side of a tile whose depths shadow maps are fitted to."""

RASTER_TILE = 32
"""Pixels along a tile's side; the layout of the visibility buffer."""
RASTER_RECORD = 12
"""Ints of a triangle that is ready for the screen."""
RASTER_COUNTERS = 2
"""Counters that the rasteriser's kernels share."""

SMOOTH_FAR = 1e4
"""Greatest distance from a tangent plane that counts for the score of a pixel, see kernels/filters/smooth_edges.cl;
pixels."""
SMOOTH_OTHER = 4.0
"""Added to the score where the material is another: as much as so many pixels from the tangent plane."""
SMOOTH_APART = 0.05
"""Times the square of the distance on the screen, so that of equals the nearest is taken."""
SMOOTH_OWN = 0.1
"""Score up to which a pixel shows what is seen at a place within it, whatever others show."""
SMOOTH_NEVER = 1e6
"""Score where one shows a surface and the other none."""

RSM_LEAST_COSINE = 0.1
"""A texel seen at a flatter angle stands for the area that it has at this cosine."""
RSM_RECORD = 12
"""Floats of a texel, see kernels/rsm/records.clh."""

SHADE_CUBE_SLOPE = 2.0404
"""Over the albedo, of A^3 in the fit of several bounces (Jimenez et al. 2016)."""
SHADE_CUBE_CONSTANT = -0.3324
SHADE_SQUARE_SLOPE = -4.7951
"""Likewise of A^2."""
SHADE_SQUARE_CONSTANT = 0.6417
SHADE_LINE_SLOPE = 2.7552
"""Likewise of A."""
SHADE_LINE_CONSTANT = 0.6903

SHADOW_BLOCK_BITS = 3
"""Binary logarithm of the texels along the side of a shadow map's block."""
SHADOW_IMAGES = 4
"""Images of planes round the blocks for each face."""

MULTIRES_TILE = 16
"""Points along a tile's side."""

GATHER_TILE = TILE
"""Points along the side of a tile whose points have other rays each; a power of two."""

BVH_LEAF, BVH_BINS, BVH_DEEPEST = LEAF, BINS, DEEPEST
"""How nodes of hierarchies are split, see `ssgi_cl.core.bvh`."""
BVH_WAITING = DEEPEST + 32
"""Nodes that wait to be split, at most: one for each level below, and one."""
RAYS_WAITING = WAITING
"""Boxes that wait to be entered on the way of a ray, at most."""

SUBSPLAT_IMAGES = 5
"""Images of a level of the min-max mipmap, see kernels/multires/variation.clh."""
SUBSPLAT_EMPTY = -1.0
"""Its depth where nothing is."""

TREE_RECORD = 12
"""Floats of a light, or of what stands for several, in the tree."""
TREE_BOUNDS = 16
"""Floats of the bounds of such a record."""
TREE_LEAF = 12
"""Floats of the bounds of a light and its parts."""
CUT_GROUP = 64
"""Consecutive samples that share a light cut: a multiple of every number of lanes."""
CUT_SAMPLE = 6
"""Floats of a sample: position and normal."""
CUT_SHARED = 1 << 16
"""Is added to the number of a listed record whose run of 64 lights has one shadow ray."""
CUT_BRIGHT = 1 << 17
"""Likewise, of which every run of 4 lights has one."""

VPL_TILE = 16
"""Pixels along the side of a tile with lists of lights: a multiple of every number of lanes."""
VPL_BOX = 16
"""Floats of a tile's bounds."""
VPL_LIGHT = 12
"""Floats of a light: position, area, minus the normal, 0, flux, 0."""
VPL_BOUNDS = 7
"""Floats of its bounds, see kernels/vpl/vpl_lists.cl."""
SURFEL_RECORD = VPL_LIGHT
"""Floats of a surfel as a light: those of a virtual point light."""
REFLECT_SMOOTH = 4000.0
"""Gloss from which on surfaces are seen in others as mirrors, and take the mean of few rays: a roughness of .15."""
AREA_EMITTER = 22
"""Floats of an emissive quadrilateral, see ssgi_cl/techniques/area_lights/emitters.py."""
AREA_SOURCE = 13
"""Floats of a triangle or parallelogram that points of an emitter are drawn from."""
AREA_QUANTILES = 64
"""Triangles of an emitter that points are drawn from, each as often."""
AREA_NOISE = 64
"""Pixels along the side of a tile of numbers that points are drawn with."""
AREA_CELL_ROWS, AREA_CELL_COLUMNS = 8, 16
"""Pixels of a cell, the eight round which tell whether its shadow rays agree."""
SKY_STRATUM = 11
"""Floats of a part of the sphere, see kernels/sky_rays/strata.clh."""
SKY_POINTS = POINTS
"""Its directions."""
SKY_CELL = 32
"""Pixels along the side of a cell, the nine round which tell what parts of the sphere send light."""
SKY_ROWS = 2
"""Rows of which one sends rays to them."""
SKY_NOISE = 64
"""Pixels along the side of a tile of numbers that rays are chosen with."""
DIRECT_LIGHT = 12
"""Floats of a punctual light that lights surfels."""
VOLUME_CELLS = 64
"""Cells along a side of the light volume. In a furnished room FLIP is .069, .059 and .050 with 32, 64 and 96; with 96
and no more surfels than 2048 walls of plainer rooms become noisier."""
DIRECT_LIGHT = 12
"""Floats of a punctual light that lights surfels."""
FIRST_GROUP = 16
"""Surfels, one after the other, that trace rays to the same virtual point lights."""
START_FEW = 16
"""Triangles that share a box within a batch; a divisor of `START_BATCH`."""
START_BATCH = 256
"""Triangles, one after the other, that share a box."""
VPL_LOBE_LIGHT = 16
"""Floats of a light with a Phong lobe."""
VPL_LOBE_BOUNDS = 12
"""Floats of its bounds."""
VPL_SHARPEST = SHARPEST
"""Exponent of a lobe at most."""
VPL_TERMS = 64
"""Lights summed before they are added to the sum: float32 rounds less so."""
OCCUPANCY_BLOCK = 4
"""Cells along the side of a block of the occupancy grid."""
OCCUPANCY_MARGIN = 6
"""Cells of the occupancy grid beside its contents along each axis, half of them on either side."""
VPL_RUN = 16
"""Texels of a run of the cumulative flux."""
VPL_BLOCK_RUNS = 64
"""Runs of a block."""
VPL_SUMS = 6
"""Sums that are made: lit texels, luminance, red, green, blue, area."""
VPL_MEANS = 2
"""Floats behind the importance of all runs: the sums of importance and of lit texels."""

ACCUMULATE_BEGIN, ACCUMULATE_NOTHING = int(Reset.FIRST), int(Reset.NOTHING)
"""Reasons for which a history begins anew, see `ssgi_cl.core.history`."""
ACCUMULATE_BORDER, ACCUMULATE_EMPTY = int(Reset.BORDER), int(Reset.EMPTY)
ACCUMULATE_PLANE, ACCUMULATE_LAYER = int(Reset.PLANE), int(Reset.LAYER)
ACCUMULATE_NORMAL, ACCUMULATE_CHANGED = int(Reset.NORMAL), int(Reset.CHANGED)

_VALUES = {
    name: value
    for name, value in list(globals().items())
    if "_" in name and name.isupper() and isinstance(value, int | float)
}
_NAMES = re.compile(r"\b(" + "|".join(_VALUES) + r")\b")


def definitions(text: str) -> list[str]:
    """Return the lines that define the constants whose names are in a kernel's text."""
    names = sorted(set(_NAMES.findall(text)))
    return [f"#define {name} {_literal(_VALUES[name])}" for name in names]


def _literal(value: float) -> str:
    """Return a number in OpenCL C."""
    text = repr(value) if isinstance(value, int) else f"{value!r}f"
    return f"({text})" if value < 0 else text
