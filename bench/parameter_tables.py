"""Tables of parameters in docs/techniques, made from the parameters' own declarations."""

from __future__ import annotations

from collections.abc import Mapping

import ssgi_cl as gi
from ssgi_cl.core.params import Params, describe
from ssgi_cl.techniques.filters.bilateral import BilateralParams

PARAMETERS: Mapping[str, type[Params]] = {
    "ssao": gi.SsaoParams,
    "hbao": gi.HbaoParams,
    "gtao": gi.GtaoParams,
    "bitmask_ao": gi.BitmaskParams,
    "bilateral_blur": BilateralParams,
    "upsample": gi.UpsampleParams,
    "shade": gi.ShadeParams,
    "radiosity": gi.RadiosityParams,
    "reflections": gi.ReflectionsParams,
    "sampled_lights": gi.SampledLightsParams,
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
    lines = ["| parameter | default | meaning (range; unit) |", "|---|---|---|"]
    lines += [f"| `{name}` | {default} | {meaning} |" for name, default, meaning in describe(params)]
    return "\n".join(lines)
