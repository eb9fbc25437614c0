"""HBAO, GTAO and the visibility bitmask, by slices, taps and depth layers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.rasterize.raster.view import MOST_LAYERS, downloaded
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams
from ssgi_cl.techniques.ao.slices import SliceParams, SliceTechnique
from ssgi_cl.techniques.catalogue import of_kind
from ssgi_cl.techniques.presets import NAMES
from ssgi_cl.truth import Truth, metrics
from ssgi_cl.truth import slices as assumption
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.choose import choose
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnView

OVERSCAN = 0.1
"""Share of the image round it that a G-buffer of several layers has."""

CONVERGED_PIXELS = 4096
"""Of a layer in which it is computed what a technique converges to."""

_SETTING = re.compile(r"([1-9]\d?)x([1-9]\d?)(?:-([1-9]\d?))?")


@dataclass(frozen=True)
class Slices(Own):
    """A technique that scans slices; the setting is SLICESxTAPS, or SLICESxTAPS-LAYERS.

    Taps count per side. Several layers come with overscan, and are drawn in each run.

    Attributes:
        make, params: the technique.
    """

    make: Any
    params: type[SliceParams]
    SETTINGS: tuple[str, ...] = ("1x4", "1x9", "2x4", "2x9", "2x9-2", "2x9-4")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the technique and its G-buffer ready."""
        match = _SETTING.fullmatch(setting)
        if match is None:
            raise ValueError(f"setting is {setting!r}: expected SLICESxTAPS or SLICESxTAPS-LAYERS, such as 2x9-4")
        slices, taps, layers = int(match[1]), int(match[2]), int(match[3] or 1)
        params = self.params(slices=slices, taps=taps, radius=context.radius)
        return _layered(context, self.make, params, layers)


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
    return Subject(
        run=lambda: technique(view.draw()),
        image=lambda: technique(view.draw()),
        quantity="occlusion",
        samples=2.0 * params.slices * params.taps * layers * np.count_nonzero(context.seen),
        moved=context.size[0] * context.size[1] * 4 * (layers + 3 + 1),
        truths=truths,
        counted=view.counted,
        note=note,
    )


def converged(context: Context, technique: SliceTechnique[Any], gbuffer: DeviceGBuffer) -> Truth:
    """Return what a technique converges to, the same for all numbers of slices and taps."""
    model = replace(
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
        f"slices of {technique.name} with {technique.layers} layers on {context.view.name}: {model}",
        lambda progress: assumption.converged(
            downloaded(gbuffer),
            model,
            pixels=CONVERGED_PIXELS // technique.layers,
            rebuild=context.truths.rebuild,
            progress=progress,
        ),
    )


@dataclass(frozen=True)
class Presets(Own):
    """A technique by the name of its preset; the setting is NAME, or NAME-LAYERS.

    Attributes:
        make: the technique.
    """

    make: Any
    SETTINGS: tuple[str, ...] = (*NAMES, "high-2", "high-4")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the technique and its G-buffer ready."""
        name, _, number = setting.partition("-")
        layers = count_of(number or "1", "NAME-LAYERS, layers", 1, MOST_LAYERS)
        chosen = choose(self.make.name, context.size, preset=name, layers=layers, radius=context.radius)
        # Tuned for the world: what each of them would converge to says nothing.
        subject = _layered(context, self.make, chosen.params, layers)
        return replace(subject, truths={"world": context.occlusion})


XEGTAO_HIGH = {"tap_power": 2.0, "falloff": 0.615, "contrast": 2.2}
"""With 3 slices, 3 taps a side and 1.457 times the radius: XeGTAO's High setting (Intel 2021)."""
XEGTAO_FACTOR = 1.457
"""Of the radius, as published."""
XEGTAO_FACTORS = (1.0, XEGTAO_FACTOR, 1.75, 2.0, 2.25, 2.5, 3.0)
"""Of the radius, of which the one of least error on the measured scene is taken for "best"."""


class XegtaoHigh(Own):
    """XeGTAO's High setting as parameters of GTAO, with this library's blur.

    The setting is "high", with the published factor of the radius, or "best", with that of
    `XEGTAO_FACTORS` which has the least RMSE against the measured scene's own rays.
    """

    SETTINGS = ("high", "best")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make it ready; "best" needs the scene's reference."""
        if setting not in self.SETTINGS:
            raise ValueError(f"setting is {setting!r}: expected 'high' or 'best'")
        factor = XEGTAO_FACTOR
        if setting == "best":
            factor = context.shared("XeGTAO's factor", lambda: _best_factor(context))
        note = f"3 slices, 3 taps a side, radius times {factor:g}, falloff .615, contrast 2.2" + (
            f", the best of {', '.join(f'{f:g}' for f in XEGTAO_FACTORS)} on this scene" if setting == "best" else ""
        )
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
    **{
        each.name: Slices(each.technique, each.technique.defaults, each.bench.settings or Slices.SETTINGS)
        for each in SCANNED
    },
    **{f"{each.name.removesuffix('_ao')}-preset": Presets(each.technique) for each in SCANNED},
    "xegtao": XegtaoHigh(),
}
