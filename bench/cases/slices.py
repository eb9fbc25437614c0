"""HBAO, GTAO and the visibility bitmask, by slices, taps and depth layers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from ssgi_cl.core import checks
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.rasterize.raster.view import MOST_LAYERS, downloaded
from ssgi_cl.techniques.ao.bitmask import BitmaskAo
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams
from ssgi_cl.techniques.ao.hbao import Hbao
from ssgi_cl.techniques.ao.slices import SliceParams, SliceTechnique
from ssgi_cl.techniques.catalogue import of_kind
from ssgi_cl.techniques.presets import NAMES
from ssgi_cl.truth import Truth, metrics
from ssgi_cl.truth import slices as assumption
from ssgi_cl.tuning.case import Family, Subject, count_of, counts_of
from ssgi_cl.tuning.choose import choose
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnView

OVERSCAN = 0.1
"""Share of the image round it that a G-buffer of several layers has."""

CONVERGED_PIXELS = 4096
"""Of a layer in which it is computed what a technique converges to."""

_SLICES = re.compile(r"([1-9]\d?)x([1-9]\d?)(?:-([1-9]\d?))?")
_MODEL = re.compile(r"([1-9]\d?)x([1-9]\d?)(-blur)?")

SETTINGS = ("1x4", "1x9", "2x4", "2x9", "2x9-2", "2x9-4")
MODEL_SETTINGS = ("2x9", "2x9-blur", "16x32", "16x64")


def scanned(context: Context, setting: str, *, make: Any) -> Subject:
    """Make a technique that scans slices ready; the setting is SLICESxTAPS, or SLICESxTAPS-LAYERS.

    Taps count per side. Several layers come with overscan, and are drawn in each run.
    """
    slices, taps, layers = counts_of(setting, _SLICES, "SLICESxTAPS or SLICESxTAPS-LAYERS, such as 2x9-4")
    params = make.defaults(slices=int(slices), taps=int(taps), radius=context.radius)
    return _layered(context, make, params, int(layers or 1))


def preset(context: Context, setting: str, *, make: Any) -> Subject:
    """Make a technique ready; the setting is NAME of its preset, or NAME-LAYERS."""
    name, _, number = setting.partition("-")
    layers = count_of(number or "1", "NAME-LAYERS, layers", 1, MOST_LAYERS)
    chosen = choose(make.name, context.size, preset=name, layers=layers, radius=context.radius)
    # Tuned for the world: what each of them would converge to says nothing.
    return replace(_layered(context, make, chosen.params, layers), truths={"world": context.occlusion})


def _layered(context: Context, make: Any, params: SliceParams, layers: int) -> Subject:
    """Return a technique on a G-buffer of some layers, with overscan if there are several."""
    view = DrawnView(context, layers, OVERSCAN if layers > 1 else 0.0)
    technique = make(context.runtime, context.size, params, view.gbuffer.margin, layers=layers)
    return _subject(context, technique, view)


def _subject(context: Context, technique: SliceTechnique[Any], view: DrawnView, note: str = "") -> Subject:
    params, layers, gbuffer = technique.params, technique.layers, view.gbuffer
    truths: dict[str, Any] = {"world": context.occlusion}
    if not getattr(params, "joined", False):
        truths["assumption"] = lambda: converged(context, technique, gbuffer)
    return Subject.of_image(
        lambda: technique(view.draw()),
        quantity="occlusion",
        samples=2.0 * params.slices * params.taps * layers * context.surface_pixels,
        moved=context.pixels * 4 * (layers + 3 + 1),
        truths=truths,
        counted=view.counted,
        note=note,
    )


def model(context: Context, setting: str, *, make: Any, **options: Any) -> Subject:
    """Make a technique at full size ready, held to what the same model converges to.

    The setting is SLICESxTAPS, without blur, or SLICESxTAPS-blur. The model counts every pixel that
    a slice crosses, up to the radius. The last tap lies half a step before that, so that the mean
    error (the bias) halves with the taps' distance: twice that of 16x64 less that of 16x32 is the
    limit's. At 100 x 75, where the built-in scenes' radii are 6 to 20 px, that is below .0004 for
    all three.
    """
    slices, taps, blurred = counts_of(setting, _MODEL, "SLICESxTAPS or SLICESxTAPS-blur, such as 2x9")
    blur: dict[str, Any] = {} if blurred else {"blur_radius": 0}
    params = make.defaults(radius=context.radius, slices=int(slices), taps=int(taps), **options, **blur)
    technique = make(context.runtime, context.size, params)
    gbuffer = context.gbuffer
    return Subject.of_image(
        lambda: technique(gbuffer),
        quantity="model",
        samples=2.0 * params.slices * params.taps * context.surface_pixels,
        truths={"assumption": lambda: converged(context, technique, gbuffer)},
        note="surfaces each with a thickness" if options else "",
    )


def converged(context: Context, technique: SliceTechnique[Any], gbuffer: DeviceGBuffer) -> Truth:
    """Return what a technique converges to, the same for all numbers of slices and taps."""
    params = replace(
        technique.params,
        slices=1,
        taps=1,
        tap_power=1.0,
        resolution="full",
        blur_radius=0,
        blur_passes=1,
        blur_resolution="own",
    )
    return context.truth(
        f"slices of {technique.name} with {technique.layers} layers on {context.view.name}: {params}",
        lambda **others: assumption.converged(downloaded(gbuffer), params, **others),
        pixels=CONVERGED_PIXELS // technique.layers,
    )


XEGTAO_HIGH = {"tap_power": 2.0, "falloff": 0.615, "contrast": 2.2}
"""With 3 slices, 3 taps a side and 1.457 times the radius: XeGTAO's High setting (Intel 2021)."""
XEGTAO_FACTOR = 1.457
"""Of the radius, as published."""
XEGTAO_FACTORS = (1.0, XEGTAO_FACTOR, 1.75, 2.0, 2.25, 2.5, 3.0)
"""Of the radius, of which the one of least error on the measured scene is taken for "best"."""


def xegtao(context: Context, setting: str) -> Subject:
    """Make XeGTAO's High setting as parameters of GTAO ready, with this library's blur.

    The setting is "high", with the published factor of the radius, or "best", with that of
    `XEGTAO_FACTORS` which has the least RMSE against the measured scene's own rays.
    """
    checks.choice("setting", setting, ("high", "best"))
    factor, tried = XEGTAO_FACTOR, ""
    if setting == "best":
        factor = context.shared("XeGTAO's factor", lambda: _best_factor(context))
        tried = f", the best of {', '.join(f'{f:g}' for f in XEGTAO_FACTORS)} on this scene"
    note = f"3 slices, 3 taps a side, radius times {factor:g}, falloff .615, contrast 2.2{tried}"
    return _subject(context, _xegtao(context, factor), DrawnView(context, 1, 0.0), note)


def _xegtao(context: Context, factor: float) -> Gtao:
    values: dict[str, Any] = dict(XEGTAO_HIGH)
    params = GtaoParams(slices=3, taps=3, radius=factor * context.radius, **values)
    return Gtao(context.runtime, context.size, params)


def _best_factor(context: Context) -> float:
    """Return the factor of the radius with the least RMSE against the scene's rays."""
    truth = context.occlusion().mean

    def error(factor: float) -> float:
        return metrics.rmse(_xegtao(context, factor)(context.gbuffer), truth, context.seen)

    return min(XEGTAO_FACTORS, key=error)


SCANNED = [each for each in of_kind("ao").values() if issubclass(each.technique, SliceTechnique)]
FAMILIES: Mapping[str, Family] = {
    **{each.name: Family(partial(scanned, make=each.technique), each.bench.settings or SETTINGS) for each in SCANNED},
    **{
        f"{each.name.removesuffix('_ao')}-preset": Family(
            partial(preset, make=each.technique), (*NAMES, "high-2", "high-4")
        )
        for each in SCANNED
    },
    "xegtao": Family(xegtao, ("high", "best")),
    "hbao-model": Family(partial(model, make=Hbao), MODEL_SETTINGS),
    "gtao-model": Family(partial(model, make=Gtao), MODEL_SETTINGS),
    # Joined surfaces have no limit of their own: ever more taps leave nothing between them.
    "bitmask-model": Family(partial(model, make=BitmaskAo, joined=False), MODEL_SETTINGS),
}
