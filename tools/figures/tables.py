"""Tables of README and of the pages in docs, made from results and from parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import ssgi_cl as gi
from ssgi_cl.bench.document import clock, metric
from ssgi_cl.bench.wording import NOTHING, markdown, median, milliseconds, number, quartiles, short_name
from ssgi_cl.core.params import Params, describe
from ssgi_cl.techniques.catalogue import CATALOGUE
from ssgi_cl.techniques.filters.bilateral import BilateralParams
from ssgi_cl.techniques.technique import Row

Result = Mapping[str, Any]

SCENE = "hall"
"""Of README's table."""

BESIDE = ("ray_ao", "multi_bounce", "shadow_maps", "blended_layers")
"""Functions that run on the host or draw, which the catalogue has not."""

PAGES = (*CATALOGUE, *BESIDE)
"""Techniques that have a page in docs/techniques."""

OTHER_ROWS: Mapping[str, Row] = {
    "rasterize.gbuffer": (
        "depth (N layers), normal, albedo, emission",
        (("1 layer", "gbuffer.1"), ("4 layers", "gbuffer.4")),
    ),
    "rasterize.rsm": ("reflective shadow map: depth, position, normal, flux", (("512 x 512", "rsm.512"),)),
    "shadow_maps": ("the shadow map of each light", (("one light, 1024 texels", "rsm.1024"),)),
    "blended_layers": ("surfaces that are seen through, in layers", (("4 layers", "blended-layers.4"),)),
    "ao": ("ambient occlusion by the technique and setting that suit a preset, an error or a time", ()),
    "ray_ao": ("ambient occlusion by Embree rays against the mesh: the reference", ()),
    "multi_bounce": ("AO corrected for light that surrounding surfaces reflect", ()),
    "render": (
        "the whole picture; FLIP in place of RMSE",
        (
            ("the camera moves", "frame.default"),
            ("the first frame", "frame-first.default"),
            ("direct light with `ssao`", "frame-ssao.16"),
        ),
    ),
}
"""Rows of README's table that are of no technique of the catalogue."""

ORDER = (
    "rasterize.gbuffer",
    "rasterize.rsm",
    "shadow_maps",
    "blended_layers",
    "ao",
    "gtao",
    "gtao(bent_normals=True)",
    "bitmask_ao",
    "hbao",
    "ssao",
    "ray_ao",
    "rsm_gather",
    "vpl_splat",
    "multires_splat",
    "ssdo",
    "radiosity",
    "reflections",
    "bilateral_blur",
    "upsample",
    "accumulate",
    "shade",
    "multi_bounce",
    "tonemap",
    "render",
)
"""Of README's table; rows that are not in it come last."""


def rows() -> list[tuple[str, str, Sequence[tuple[str, str]]]]:
    """Return (call, what it computes, figures) of each row of README's table."""
    every = {**OTHER_ROWS}
    for technique in CATALOGUE.values():
        every.update(technique.bench.rows)
    calls = sorted(every, key=lambda call: ORDER.index(call) if call in ORDER else len(ORDER))
    return [(call, *every[call]) for call in calls]


FAMILIES: Mapping[str, tuple[str, ...]] = {
    **{name: each.bench.families for name, each in CATALOGUE.items() if each.bench.families},
    "ray_ao": ("embree",),
}
"""Technique -> families of cases that its page shows."""

SPEED_UPS: Sequence[tuple[str, str, tuple[str, ...]]] = (
    (
        "multires.10-permille",
        "vpl-plain.1024",
        ("vpl.1024", "vpl-interleaved.1024", "rsm-gather.400", "rsm-gather-adaptive.400"),
    ),
    (
        "vpl-interleaved.1024",
        "vpl-plain.1024",
        ("vpl.1024", "multires.10-permille", "rsm-gather.400", "rsm-gather-adaptive.400"),
    ),
    ("rsm-gather-adaptive.400", "rsm-gather.400", ("vpl.1024", "vpl-interleaved.1024", "multires.10-permille")),
    ("multires-visibility.4096", "vpl-visibility.4096", ("vpl-visibility.1024", "vpl.1024", "multires.10-permille")),
)
"""Case, the plain way to the same light, and its alternatives in this library."""

VISIBILITY = ("vpl-visibility.4096", "multires-visibility.4096")
"""Cases whose bias is shown for every scene."""

AS_GOOD = 1.05
"""An alternative reaches the error of a case if its own is at most this factor of it."""


def techniques(results: Sequence[Result]) -> str:
    """Return README's table: a row a setting of a call."""
    by_name = {short_name(r): r for r in results if r["scene"] == SCENE}
    sizes = {tuple(r["size"]) for r in by_name.values()}
    size = ", ".join(f"{columns} x {rows}" for rows, columns in sorted(sizes))
    lines = []
    for call, meaning, cases in rows():
        shown = f"[`{call}`](docs/techniques/{call}.md)" if call in PAGES else f"`{call}`"
        for label, name in cases or (("", ""),):
            result = by_name.get(name)
            figures = (NOTHING, NOTHING) if result is None else (median(result), _rmse(result) or NOTHING)
            lines.append((shown, meaning, label, *figures))
            shown = meaning = ""
    head = ("call", "what it computes", f"setting; {SCENE}, {size}", "ms", "RMSE")
    return "\n".join(markdown(head, lines, "lllrr"))


def cases_of(results: Sequence[Result], technique: str) -> str:
    """Return the table of a technique's page: a row a case, a column a scene."""
    rows = [r for r in results if r["family"] in FAMILIES[technique]]
    size = ", ".join(sorted({f"{r['size'][1]} x {r['size'][0]}" for r in rows}))
    cells = {(short_name(r), r["scene"]): r for r in rows}
    scenes = list(dict.fromkeys(r["scene"] for r in rows))
    names = dict.fromkeys(short_name(r) for r in rows)
    lines = ((name, *(_figure(cells.get((name, scene))) for scene in scenes)) for name in names)
    return "\n".join(markdown((f"case, {size}", *scenes), lines, "l" * (1 + len(scenes))))


def _figure(result: Result | None) -> str:
    """Return what was measured of a case, in a few words."""
    if result is None:
        return NOTHING
    time = milliseconds(result)
    if time != NOTHING:
        time = f"{time} ({quartiles(result)})"
    rmse = _rmse(result)
    error = f"RMSE {rmse}" if rmse else ""
    return ", ".join(part for part in (time, error) if part and part != NOTHING)


def _rmse(result: Result) -> str:
    """Return the RMSE of AO or an angle, of light that in per cent of the reference's mean."""
    error, mean = metric(result, "world", "rmse"), metric(result, "world", "mean")
    if error is None:
        return ""
    if result["quantity"] in ("direct", "bounce") and mean:
        return f"{100.0 * error / mean:.3g} %"
    return number(error)


def speed_ups(results: Sequence[Result]) -> str:
    """Return how many times as fast cases are as the best alternative and as the plain way."""
    head = ("case", "scene", "ms", "best alternative with no more error", "times as fast", "plain", "times as fast")
    lines = []
    for scene in dict.fromkeys(r["scene"] for r in results):
        found = {short_name(r): r for r in results if r["scene"] == scene and r["quantity"] == "bounce"}
        for case, plain, alternatives in SPEED_UPS:
            if case not in found:
                continue
            row = found[case]
            best = best_alternative(row, [found[name] for name in alternatives if name in found])
            cells = [short_name(row), scene, milliseconds(row)]
            for other in (best, found.get(plain)):
                cells += (
                    [NOTHING, NOTHING]
                    if other is None
                    else [
                        f"{short_name(other)}, {milliseconds(other)} ms",
                        number(clock(other)["median"] / clock(row)["median"]),
                    ]
                )
            lines.append(cells)
    return "\n".join(markdown(head, lines, "llrlrlr"))


def best_alternative(row: Result, others: Sequence[Result]) -> Any:
    """Return the fastest of other results whose error is as small as a row's, or None."""
    error = metric(row, "world", "rmse")
    fitting = [
        other
        for other in others
        if error is not None and (own := metric(other, "world", "rmse")) is not None and own <= AS_GOOD * error
    ]
    return min(fitting, key=lambda r: clock(r)["median"], default=None)


def indirect_blocks(results: Sequence[Result]) -> dict[str, str]:
    """Return the blocks of docs/indirect.md."""
    traced = {r["scene"] for r in results if r["family"] == "mitsuba-path"}
    return {
        "indirect-paths": by_scene(
            [r for r in results if r["scene"] in traced],
            ("vpl-visibility", "multires-visibility", "mitsuba-path", "mitsuba-path-oidn"),
            "bounce",
        ),
        "indirect-visibility": biases(results, VISIBILITY),
        "indirect-cut": by_scene(results, ("vpl-cut", "vpl-cut-restored", "vpl-cut-plain"), "cut", "assumption"),
        "indirect-lobes": by_scene(
            results, ("vpl-lobes", "vpl-lobes-cut", "vpl-lobes-plain"), "mirrored", "assumption"
        ),
        "indirect-ssdo": by_scene(
            results,
            ("ssdo-far", "ssdo-far-overscan", "ssdo-far-layer", "ssdo-far-layers", "ssdo-far-views", "ssdo-far-all"),
            "bounce",
            flip=True,
        ),
    }


def biases(results: Sequence[Result], cases: Sequence[str]) -> str:
    """Return a table: a row a scene, and for each case bias and RMSE in per cent of the mean."""
    found = {(short_name(r), r["scene"]): r for r in results}
    scenes = dict.fromkeys(r["scene"] for r in results if short_name(r) in cases)
    head = ["", *(part for case in cases for part in (f"{case}, bias", "RMSE"))]
    lines = []
    for scene in scenes:
        cells = [scene]
        for case in cases:
            row = found.get((case, scene))
            mean = None if row is None else metric(row, "world", "mean")
            for name, variant in (("bias", "+.3g"), ("rmse", ".3g")):
                value = None if row is None else metric(row, "world", name)
                cells.append(NOTHING if value is None or not mean else f"{100.0 * value / mean:{variant}} %")
        lines.append(cells)
    return "\n".join(markdown(head, lines, "l" + "rr" * len(cases)))


def by_scene(
    results: Sequence[Result], families: Sequence[str], quantity: str, truth: str = "world", *, flip: bool = False
) -> str:
    """Return a table: a row a case, and for each scene time, error in per cent, and HDR-FLIP.

    Args:
        results: of several scenes.
        families, quantity: which of them.
        truth: what the error is against.
        flip: whether FLIP is shown.
    """
    rows = [r for r in results if r["family"] in families and r["quantity"] == quantity]
    scenes = list(dict.fromkeys(r["scene"] for r in rows))
    cells = {(short_name(r), r["scene"]): r for r in rows}
    names = sorted(dict.fromkeys(short_name(r) for r in rows), key=lambda name: families.index(name.partition(".")[0]))
    columns = ("RMSE", "FLIP") if flip else ("RMSE",)
    head = ["", *(part for scene in scenes for part in (f"{scene}, ms", *columns))]
    lines = (
        [name, *(part for scene in scenes for part in _cell(cells.get((name, scene)), truth, flip=flip))]
        for name in names
    )
    return "\n".join(markdown(head, lines, "l" + "r" * len(head[1:])))


def _cell(result: Result | None, truth: str, *, flip: bool) -> list[str]:
    if result is None:
        return [NOTHING] * (3 if flip else 2)
    error, mean = metric(result, truth, "rmse"), metric(result, truth, "mean")
    share = NOTHING if error is None or not mean else f"{100.0 * error / mean:.3g} %"
    cells = [f"{milliseconds(result)} ({quartiles(result)})", share]
    return [*cells, number(metric(result, truth, "flip"))] if flip else cells


PARAMETERS: Mapping[str, type[Params]] = {
    "ssao": gi.SsaoParams,
    "hbao": gi.HbaoParams,
    "gtao": gi.GtaoParams,
    "bitmask_ao": gi.BitmaskParams,
    "bilateral_blur": BilateralParams,
    "upsample": gi.UpsampleParams,
    "accumulate": gi.AccumulateParams,
    "shade": gi.ShadeParams,
    "radiosity": gi.RadiosityParams,
    "reflections": gi.ReflectionsParams,
    "sampled_lights": gi.SampledLightsParams,
    "sky_rays": gi.SkyRaysParams,
    "area_lights": gi.AreaLightsParams,
    "tonemap": gi.TonemapParams,
    "ssdo": gi.SsdoParams,
    "rsm_gather": gi.RsmGatherParams,
    "rsm_gather-published": gi.RsmPublishedParams,
    "vpl_splat": gi.VplSplatParams,
    "multires_splat": gi.MultiresSplatParams,
    "multires_splat-published": gi.MultiresPublishedParams,
}
"""Name of a block, without its `parameters-` -> the parameters that it lists."""


def parameter_blocks() -> dict[str, str]:
    """Return name of a block -> a Markdown table of parameter, default and meaning."""
    return {f"parameters-{name}": table(params) for name, params in PARAMETERS.items()}


def table(params: type[Params]) -> str:
    """Return a Markdown table: a row a parameter."""
    rows = ((f"`{name}`", default, meaning) for name, default, meaning in describe(params))
    return "\n".join(markdown(("parameter", "default", "meaning (range; unit)"), rows, "lll"))
