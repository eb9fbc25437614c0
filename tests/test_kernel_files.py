"""The kernel files: one kernel each, headers, macros and literals."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

import pytest

from ssgi_cl.device import sources
from ssgi_cl.device.gbuffer import VIEW_ROTATION
from ssgi_cl.device.rsm import FACE
from ssgi_cl.device.structs import CAMERA, Struct
from ssgi_cl.rasterize import rasterizer, shadow_map
from ssgi_cl.techniques.ao.slices import SLICES
from ssgi_cl.techniques.ao.ssao import SSAO
from ssgi_cl.techniques.filters.bilateral import BLUR
from ssgi_cl.techniques.filters.upsample import UPSAMPLE
from ssgi_cl.techniques.indirect import ssdo_bitmask
from ssgi_cl.techniques.indirect.flux_curve import CURVE
from ssgi_cl.techniques.indirect.multires_grid import MULTIRES
from ssgi_cl.techniques.indirect.multires_published import SUBSPLAT
from ssgi_cl.techniques.indirect.occupancy_grid import TURN
from ssgi_cl.techniques.indirect.packed_vpls import PLACE, VPL
from ssgi_cl.techniques.indirect.rsm_maps import GATHER, MAP
from ssgi_cl.techniques.indirect.rsm_published import INTERPOLATE
from ssgi_cl.techniques.indirect.rsm_samples import SUMS
from ssgi_cl.techniques.indirect.ssdo import SPLIT
from ssgi_cl.techniques.indirect.ssdo_point_views import POINT_VIEWS
from ssgi_cl.techniques.indirect.ssdo_points import POINTS
from ssgi_cl.techniques.indirect.ssdo_views import VIEWS
from ssgi_cl.techniques.indirect.ssdo_views_unseen import UNSEEN
from ssgi_cl.techniques.indirect.vpl_tree import CUT
from ssgi_cl.techniques.shading.layer_shading import LIT
from ssgi_cl.techniques.shading.light_data import LIGHT
from ssgi_cl.techniques.shading.light_shadows import LAMP_SHADOW
from ssgi_cl.techniques.shading.shade import COMBINE
from ssgi_cl.techniques.tiles import TILES


@dataclass(frozen=True)
class Use:
    """How the library builds a kernel: its structs, and sets of macros that reach every line."""

    structs: tuple[Struct, ...] = ()
    macros: Sequence[Mapping[str, int]] = field(default_factory=lambda: [{}])


def ssao(radii: int, hemisphere: int, falloff: int, outside: int) -> dict[str, int]:
    return {
        "SSAO_MOST_SAMPLES": 16, "SSAO_RADII": radii, "SSAO_HEMISPHERE": hemisphere,
        "SSAO_FALLOFF": falloff, "SSAO_CURVE_SIZE": 2, "SSAO_OUTSIDE": outside,
    }


def tiles(peel: int, cutout: int, wide: int, high: int) -> dict[str, int]:
    return {
        "RASTER_PEEL": peel, "RASTER_CUTOUT": cutout, "RASTER_WIDE": wide, "RASTER_HIGH": high
    }


def attributes(
    step: int, shaded: int, textured: int, colored: int, emission: int
) -> dict[str, int]:
    return {
        "RASTER_STEP": step, "RASTER_SHADED": shaded, "RASTER_TEXTURED": textured,
        "RASTER_COLORED": colored, "RASTER_EMISSION": emission,
    }


def light(kind: int, shadow: int, add: int) -> dict[str, int]:
    return {"SHADE_KIND": kind, "SHADE_SHADOW": shadow, "SHADE_ADD": add}


def combine(*switches: int) -> dict[str, int]:
    names = ("DIRECT", "AO", "BOUNCES", "INDIRECT", "EMISSION", "AMBIENT", "SKY")
    macros = {f"SHADE_{name}": switch for name, switch in zip(names, switches, strict=True)}
    return {**macros, "AMBIENT_SIZE": 64 * macros["SHADE_SKY"]}


def disk(listed: int, rotated: int, sphere: int, points: int) -> dict[str, int]:
    return {
        "RSM_GATHER_LISTED": listed, "RSM_GATHER_ROTATED": rotated, "RSM_GATHER_SPHERE": sphere,
        "RSM_GATHER_POINTS": points,
    }


def slices(layers: int, **switches: int) -> dict[str, int]:
    return {"SLICES_COUNT": 3, "SLICES_TAPS": 6, "SLICES_LAYERS": layers, **switches}


SIGHT = {"VPL_GRID": 64}

USES = {
    "bilateral/bilateral_blur.cl": Use(
        (CAMERA, BLUR),
        [
            {"BLUR_RADIUS": 2, "BLUR_COUNT": 3, "BLUR_SHAPE": shape, "BLUR_ROWS": rows}
            for shape, rows in ((0, 1), (1, 2), (2, 1))
        ],
    ),
    "bitmask_ao/bitmask_ao.cl": Use(
        (CAMERA, SLICES), [
            slices(
                layers, SLICES_DEEPER=n, BITMASK_ANGLE=a, BITMASK_JOINED=b, SLICES_THICKNESS=c,
                SLICES_NEXT=d,
            )
            for layers, n, a, b, c, d in
            ((1, 6, 0, 1, 0, 0), (2, 2, 1, 1, 1, 1), (2, 6, 1, 0, 1, 1))
        ],
    ),
    "calibrate/calibrate_copy.cl": Use(),
    "calibrate/calibrate_gather.cl": Use(
        (), [{"CALIBRATE_GATHERS": 64, "CALIBRATE_REACH": 4}]
    ),
    "calibrate/calibrate_multiply_add.cl": Use((), [{"CALIBRATE_STEPS": 128}]),
    "gbuffer/gbuffer_normals.cl": Use(
        (CAMERA, VIEW_ROTATION), [{"GBUFFER_GIVEN": given} for given in (0, 1)]
    ),
    "gbuffer/gbuffer_reduce.cl": Use(
        (), [{"REDUCE_COUNT": 3, "UPSAMPLE_STEP": step} for step in (4, 8)]
    ),
    "gtao/gtao.cl": Use(
        (CAMERA, SLICES),
        [slices(1, GTAO_FALLOFF=0, GTAO_BENT=0), slices(2, GTAO_FALLOFF=1, GTAO_BENT=1)],
    ),
    "gtao/gtao_bent.cl": Use((VIEW_ROTATION,)),
    "hbao/hbao.cl": Use(
        (CAMERA, SLICES),
        [
            slices(1, HBAO_ATTENUATION=0, HBAO_BIAS=1),
            slices(2, HBAO_ATTENUATION=1, HBAO_BIAS=0),
        ],
    ),
    "light_shadows/light_shadows.cl": Use(
        (CAMERA, LIGHT, LAMP_SHADOW),
        [
            {"SHADE_KIND": kind, "SHADE_ADD": add, "LAMP_TAPS": 12, "LAMP_LAYERS": layers,
             "LAMP_THICKNESS": add}
            for kind, add, layers in ((0, 0, 1), (1, 1, 2), (2, 0, 1))
        ],
    ),
    "layer_shading/layer_shading.cl": Use(
        (LIT,),
        [
            {"LIT_LAMPS": lamps, "LIT_AMBIENT": sky, "LIT_OPENNESS": openness,
             "LIT_EMISSION": emission, "LIT_RECORDS": emission, "LIT_STEP": step,
             "AMBIENT_SIZE": 64 * (step // 2)}
            for lamps, sky, openness, emission, step in (
                (0, 0, 0, 1, 1), (0, 1, 0, 1, 1), (1, 1, 1, 0, 2)
            )
        ],
    ),
    "multires/cluster_order.cl": Use((CAMERA, VPL)),
    "multires/cluster_runs.cl": Use((CAMERA, VPL)),
    "multires/cut_limits.cl": Use(),
    "multires/cut_lists.cl": Use((CAMERA, VPL, CUT)),
    "multires/cut_mean.cl": Use(
        (CAMERA, VPL), [{"VPL_NEAR": near, "VPL_CUT": near} for near in (0, 1)]
    ),
    "multires/multires_count.cl": Use(),
    "multires/multires_interpolate.cl": Use(
        (CAMERA, MULTIRES), [{"MULTIRES_CHANNELS": channels} for channels in (1, 3)]
    ),
    "multires/multires_list.cl": Use(),
    "multires/multires_reduce.cl": Use((CAMERA,)),
    "multires/multires_rough.cl": Use((CAMERA, MULTIRES), [{"MULTIRES_CHANNELS": 3}]),
    "multires/multires_start.cl": Use((), [{"MULTIRES_CHANNELS": 3}]),
    "multires/shade_list.cl": Use(
        (CAMERA, VPL, CUT),
        [
            {**SIGHT, "VPL_NEAR": n, "VPL_CUT": n, "VPL_SIGHT": n, "SHADE_ROWS": 2,
             "SHADE_LINE": line, "SHADE_PARTS": parts}
            for n, line, parts in ((0, 2, 0), (0, 2, 1), (1, 1, 1), (1, 2, 0), (1, 3, 1))
        ],
    ),
    "multires_published/subsplat_mip.cl": Use(),
    "multires_published/subsplat_refine.cl": Use((SUBSPLAT,)),
    "multires_published/subsplat_shade.cl": Use(
        (CAMERA, VPL), [{"VPL_NEAR": 0, "VPL_CUT": 0, "SUBSPLAT_ROWS": rows} for rows in (1, 4)]
    ),
    "multires_published/subsplat_upsample.cl": Use(),
    "multires_published/subsplat_variation.cl": Use(),
    "probe/probe_gather.cl": Use(),
    "raster/raster_attributes.cl": Use(
        rasterizer.STRUCTS,
        [attributes(1, 0, 0, 0, 0), attributes(2, 1, 0, 0, 0), attributes(1, 1, 1, 1, 1)],
    ),
    "raster/raster_depth.cl": Use(rasterizer.STRUCTS),
    "raster/raster_fill.cl": Use(rasterizer.STRUCTS),
    "raster/raster_flux.cl": Use((CAMERA, shadow_map.FLUX)),
    "raster/raster_gloss.cl": Use((), [{"RASTER_STEP": step} for step in (1, 3)]),
    "raster/raster_scan.cl": Use(rasterizer.STRUCTS),
    "raster/raster_setup.cl": Use(
        rasterizer.STRUCTS, [{"RASTER_BOXED": 256, "RASTER_RUN": run} for run in (16, 256)]
    ),
    "raster/raster_tiles.cl": Use(
        rasterizer.STRUCTS, [tiles(0, 0, 32, 32), tiles(1, 1, 16, 1)]
    ),
    "raster/raster_vertices.cl": Use(rasterizer.STRUCTS),
    "rsm/rsm_face.cl": Use((CAMERA, FACE)),
    "rsm/rsm_lobe.cl": Use((CAMERA, FACE)),
    "rsm/rsm_normals.cl": Use((VIEW_ROTATION,)),
    "rsm_gather/rsm_gather_bound.cl": Use(),
    "rsm_gather/rsm_gather_disk.cl": Use(
        (CAMERA, GATHER, MAP),
        [disk(0, 0, 0, 0), disk(1, 1, 0, 0), disk(0, 1, 1, 0), disk(1, 0, 1, 1)],
    ),
    "rsm_gather/rsm_gather_pick.cl": Use(),
    "rsm_gather/rsm_gather_same.cl": Use(
        (CAMERA, GATHER), [{"RSM_GATHER_LISTED": listed} for listed in (0, 1)]
    ),
    "rsm_gather/rsm_gather_sums.cl": Use((SUMS,)),
    "rsm_gather/rsm_gather_texels.cl": Use(),
    "rsm_published/rsm_published_interpolate.cl": Use((CAMERA, INTERPOLATE)),
    "rsm_published/rsm_published_lattice.cl": Use(),
    "shade/shade_combine.cl": Use(
        (CAMERA, COMBINE),
        [combine(0, 0, 0, 0, 0, 0, 0), combine(1, 1, 1, 1, 1, 1, 1), combine(0, 1, 0, 2, 0, 1, 0)],
    ),
    "shade/shade_light.cl": Use(
        (CAMERA, LIGHT), [light(0, 0, 0), light(0, 1, 1), light(1, 1, 0), light(2, 1, 1)]
    ),
    "shade/shadow_blocks.cl": Use((), [{}]),
    "slices/slices_slopes.cl": Use(
        (CAMERA,), [{"SLOPES_LAYERS": 2, "SLOPES_NORMALS": n} for n in (1, 2)]
    ),
    "slices/slices_sorted.cl": Use((), [{"SORTED_COUNT": 6}]),
    "ssdo_bitmask/ssdo_bitmask.cl": Use(
        (CAMERA, SLICES, ssdo_bitmask.OWN),
        [
            slices(
                layers, SLICES_THICKNESS=a, SLICES_NEXT=b, BITMASK_THICK=a, BITMASK_BOUNCE=c,
                BITMASK_BACKS=d, BITMASK_CONES=e, BITMASK_KEPT=f, BITMASK_SIDES=d,
                BITMASK_BENT=8 - e, SKY_SIZE=32,
            )
            for layers, a, b, c, d, e, f in ((1, 0, 0, 1, 0, 8, 1), (2, 1, 1, 1, 1, 0, 0))
        ],
    ),
    "slices/slices_near.cl": Use(
        (CAMERA,), [{"NEAR_LAYERS": 2, "NEAR_THICKNESS": thick} for thick in (0, 1)]
    ),
    "ssao/ssao.cl": Use((CAMERA, SSAO), [ssao(1, 0, 0, 0), ssao(4, 1, 1, 1), ssao(2, 1, 2, 0)]),
    "ssdo/ssdo_sides.cl": Use((VIEW_ROTATION,), [{"SIDES_LAYERS": 3}]),
    "ssdo/ssdo_split.cl": Use(
        (SPLIT,),
        [
            {"SPLIT_GATHERED": gathered, "SPLIT_SKY": sky, "SPLIT_BOUNCE": bounce,
             "SPLIT_LAMPS": lamps, "SPLIT_FIRST": 1 + 3 * sky}
            for gathered, sky, bounce, lamps in ((0, 0, 1, 1), (1, 0, 0, 0), (1, 1, 1, 1))
        ],
    ),
    "ssdo_point_views/ssdo_point_views.cl": Use(
        (CAMERA, POINTS, POINT_VIEWS),
        [
            {"POINT_VIEWS_COUNT": 4, "POINTS_TAPS": taps, "POINTS_LAYERS": layers,
             "POINT_VIEWS_SENDERS": senders, "POINT_VIEWS_STEP": step, "POINT_VIEWS_SKY": sky,
             "POINTS_PUBLISHED": published, "POINTS_THICKNESS": 2 * sky}
            for taps, layers, senders, step, sky, published in (
                (4, 1, 0, 1, 0, 0), (4, 2, 1, 2, 1, 0), (1, 2, 1, 2, 1, 1)
            )
        ],
    ),
    "ssdo_points/ssdo_planes.cl": Use(
        (CAMERA,),
        [{"PLANES_LAYERS": 2, "PLANES_NORMALS": normals} for normals in (1, 2)],
    ),
    "ssdo_points/ssdo_points.cl": Use(
        (CAMERA, POINTS),
        [
            {"POINTS_COUNT": 4, "POINTS_TAPS": taps, "POINTS_LAYERS": layers,
             "POINTS_SENDERS": senders, "POINTS_STEP": step, "POINTS_SKY": sky,
             "POINTS_PUBLISHED": published, "POINTS_THICKNESS": layers - 1 - published,
             "POINTS_KEPT": sky}
            for taps, layers, senders, step, sky, published in (
                (4, 1, 0, 1, 0, 0), (4, 2, 2, 2, 1, 0), (1, 3, 1, 4, 0, 1)
            )
        ],
    ),
    "ssdo_views/ssdo_views.cl": Use(
        (CAMERA, VIEWS),
        [
            {"VIEWS_SLICES": 2, "VIEWS_STRATA": 2, "VIEWS_TAPS": 4, "VIEWS_LAYERS": layers,
             "VIEWS_NORMALS": layers, "VIEWS_SENDERS": senders, "VIEWS_BOUNCE": 1}
            for layers, senders in ((1, 0), (2, 2))
        ],
    ),
    "ssdo_views/ssdo_views_unseen.cl": Use(
        (CAMERA, UNSEEN),
        [{"UNSEEN_LAYERS": 2, "UNSEEN_NORMALS": 1, "SEEN_LAYERS": 2, "SEEN_NORMALS": 1}],
    ),
    "tiles/tiles_calm.cl": Use(),
    "tiles/tiles_facts.cl": Use(
        (CAMERA,), [{"TILES_LAYERS": n, "TILES_PIECES": n - 1} for n in (1, 2)]
    ),
    "tiles/tiles_open.cl": Use((TILES,), [{"TILES_PIECES": pieces} for pieces in (0, 1)]),
    "tonemap/tonemap.cl": Use((), [{"TONEMAP_CURVE": curve} for curve in (0, 1)]),
    "upsample/upsample_blur_columns.cl": Use(
        (CAMERA, UPSAMPLE), [{"UPSAMPLE_STEP": step, "BLUR_RADIUS": 7} for step in (2, 4)]
    ),
    "upsample/upsample_blur_rows.cl": Use(
        (CAMERA, UPSAMPLE), [{"UPSAMPLE_STEP": step, "BLUR_RADIUS": 7} for step in (2, 4)]
    ),
    "upsample/upsample_joint.cl": Use(
        (CAMERA, UPSAMPLE),
        [{"UPSAMPLE_COUNT": 3, "UPSAMPLE_STEP": step} for step in (1, 2, 4)],
    ),
    "vpl/vpl_blocks.cl": Use((CURVE,)),
    "vpl/vpl_boxes.cl": Use((CAMERA, VPL)),
    "vpl/vpl_cut.cl": Use((CURVE,), [
        {"VPL_MIDDLE": middle, "VPL_GLOSSY": glossy, "VPL_WEIGHTED": weighted}
        for middle, glossy, weighted in ((0, 0, 0), (1, 0, 1), (0, 1, 0), (1, 1, 0), (0, 0, 1))
    ]),
    "vpl/vpl_grid.cl": Use((CAMERA, VPL), [SIGHT]),
    "vpl/vpl_interleaved.cl": Use(
        (CAMERA, VPL),
        [
            {**SIGHT, "VPL_NEAR": near, "VPL_CUT": cut, "VPL_ADD": add, "VPL_SIGHT": 1 - add,
             "VPL_SHARE": 16, "VPL_GLOSSY": glossy, "VPL_PARTS": cut % 2 * (1 - glossy)}
            for near, cut, add, glossy in ((0, 0, 0, 0), (1, 1, 1, 0), (0, 2, 1, 0), (1, 1, 0, 1))
        ],
    ),
    "vpl/vpl_lists.cl": Use(
        (CAMERA, VPL),
        [
            {"VPL_CUT": cut, "VPL_SUBSETS": 1 + 15 * cut, "VPL_PARTS": parts, "VPL_GLOSSY": glossy}
            for cut, parts, glossy in ((0, 0, 0), (1, 1, 0), (0, 0, 1), (1, 0, 1))
        ],
    ),
    "vpl/vpl_near.cl": Use((CAMERA, VPL)),
    "vpl/vpl_reach.cl": Use((CAMERA, VPL), [SIGHT]),
    "vpl/vpl_occupy.cl": Use((CAMERA, VPL, TURN), [{**SIGHT, "VPL_LAYERS": n} for n in (0, 2)]),
    "vpl/vpl_place.cl": Use(
        (PLACE,),
        [{"VPL_PART": part, "VPL_GLOSSY": glossy} for part, glossy in ((0, 0), (1, 0), (0, 1))],
    ),
    "vpl/vpl_runs.cl": Use(
        (CURVE,),
        [{"VPL_GLOSSY": glossy, "VPL_WEIGHTED": weighted}
         for glossy, weighted in ((0, 0), (1, 0), (0, 1))],
    ),
    "vpl/vpl_splat.cl": Use(
        (CAMERA, VPL),
        [
            {"VPL_NEAR": near, "VPL_CUT": cut, "VPL_LISTS": add, "VPL_ADD": add, "VPL_PARTS": add,
             "VPL_ROWS": 2, "VPL_GLOSSY": glossy}
            for near, cut, add, glossy in ((0, 0, 0, 0), (1, 1, 1, 0), (0, 2, 1, 0))
        ]
        + [
            {"VPL_NEAR": cut, "VPL_CUT": cut, "VPL_LISTS": 1, "VPL_ADD": 1, "VPL_PARTS": 0,
             "VPL_ROWS": 2, "VPL_GLOSSY": 1}
            for cut in (0, 1)
        ],
    ),
    "vpl/vpl_totals.cl": Use(),
    "vpl/vpl_view_importance.cl": Use((CAMERA, VPL, CURVE, TURN), [SIGHT]),
    "vpl/vpl_view_mean.cl": Use(),
    "vpl/vpl_voxelize.cl": Use(
        (CAMERA, VPL, TURN), [{**SIGHT, "VOXEL_CUTOUT": cutout} for cutout in (0, 1)]
    ),
}
"""Every kernel. A new one belongs here."""

every_kernel = pytest.mark.parametrize("path", sources.kernel_names())
every_use = pytest.mark.parametrize("path", USES)


def text_of(path: str) -> str:
    return files("ssgi_cl.kernels").joinpath(*path.split("/")).read_text(encoding="utf-8")


def code_of(text: str) -> str:
    """The text without comments."""
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)


def all_files() -> list[str]:
    """Every kernel and every file that kernels include."""
    root = files("ssgi_cl.kernels")
    return sorted(
        f"{folder.name}/{file.name}"
        for folder in root.iterdir()
        if folder.is_dir()
        for file in folder.iterdir()
        if file.name.endswith((".cl", ".clh"))
    )


def test_the_table_above_has_every_kernel() -> None:
    assert sorted(USES) == sources.kernel_names()


@every_kernel
def test_a_file_holds_one_kernel_of_its_own_name(path: str) -> None:
    assert re.findall(r"__kernel\s+void\s+(\w+)", code_of(text_of(path))) == [Path(path).stem]


@pytest.mark.parametrize("path", all_files())
def test_a_file_begins_with_its_licence_and_its_name(path: str) -> None:
    first, second = text_of(path).splitlines()[:2]
    assert first == "// SPDX-License-Identifier: MIT"
    name = Path(path).stem
    start = name if path.endswith(".cl") else name.capitalize()
    assert re.match(rf"// {start}: \S", second), second


@every_use
def test_a_kernel_refuses_to_build_without_its_macros_and_explains_them(path: str) -> None:
    text = text_of(path)
    header = text.split("\n\n", 1)[0]
    # Conditions that end in #error, continued lines joined.
    joined = text.replace("\\\n", " ")
    guards = " ".join(re.findall(r"^#if(.*)\n#error", joined, flags=re.MULTILINE))
    for macro in {name for macros in USES[path].macros for name in macros}:
        assert re.search(rf"ndef {macro}$|!defined\({macro}\)", guards), macro
        assert macro in header, f"{macro} is not in the file's header comment"


@pytest.mark.parametrize("path", all_files())
def test_every_literal_is_a_float_or_an_integer(path: str) -> None:
    # 1.0 without an f is a double in OpenCL C, which devices need not have.
    number = r"(?<![\w.])(?:\d+\.\d*|\.\d+|\d+(?=[eE]))(?:[eE][+-]?\d+)?(?![\w.])"
    assert re.findall(number, code_of(text_of(path))) == []
