"""What `render` makes of its arguments: parameters of ambient occlusion and of one bounce."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

from ssgi_cl.core import checks
from ssgi_cl.core.params import Params
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.one_bounce import OneBounceParams
from ssgi_cl.techniques.ao.occlusion import OcclusionParams, OcclusionTechnique
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.indirect import multires_splat, rsm_gather
from ssgi_cl.techniques.indirect.multires_published import MultiresPublishedParams
from ssgi_cl.techniques.indirect.multires_splat import MultiresSplatParams
from ssgi_cl.techniques.indirect.occupancy_grid import MOST_CELLS
from ssgi_cl.techniques.indirect.rsm_gather import RsmGatherParams
from ssgi_cl.techniques.indirect.rsm_published import RsmPublishedParams
from ssgi_cl.techniques.indirect.ssdo_params import SsdoParams
from ssgi_cl.techniques.indirect.vpl_splat import VplSplatParams

AO_DEFAULT = "gtao"
BOUNCES = ("multires", "vpl", "gather", "ssdo")
"""The first is the default of one bounce."""

BounceParams = OneBounceParams | SsdoParams


def shape_of(params: Params | None) -> Hashable:
    """Return the part of parameters that a renderer is prepared for."""
    return None if params is None else params.shape()


def ao_name(ao: object, samples: int | None) -> str | None:
    """Return the name of the technique that dims ambient light, or None."""
    if not isinstance(ao, (bool, str)):
        raise TypeError(f"ao is {ao!r}: expected True, False or the name of a technique")
    name = AO_DEFAULT if ao is True else ao
    if isinstance(name, str):
        checks.choice("ao", name, tuple(TECHNIQUES))
    if samples is not None and name != "ssao":
        raise ValueError(f"ao_samples is {samples}: expected None with ao={ao!r}, it is of 'ssao'")
    return name or None


def ao_technique(
    runtime: Runtime, size: Size, params: OcclusionParams, margin: Size, layers: int
) -> tuple[str, OcclusionTechnique]:
    """Return name and technique of the ambient occlusion that has such parameters."""
    name, kind = next((name, entry.technique) for name, entry in TECHNIQUES.items() if type(params) is entry.params)
    return name, kind(runtime, size, params, margin, layers)


def bounce_name(indirect: object) -> str | None:
    """Return how one bounce of light is found, or None."""
    if isinstance(indirect, bool):
        return BOUNCES[0] if indirect else None
    if indirect is not None and not isinstance(indirect, str):
        raise TypeError(f"indirect is {indirect!r}: expected True, False, None or the name of a technique")
    return None if indirect is None else checks.choice("indirect", indirect, BOUNCES)


def bounce_methods(name: str | None) -> tuple[str, ...]:
    """Return the methods of a bounce by its name; none if there is but one way to compute it."""
    if name == "ssdo":
        fields: dict[str, Any] = SsdoParams.__dataclass_fields__
        choices: tuple[str, ...] = fields["method"].metadata["choices"]
        return choices
    methods = {"multires": multires_splat.METHODS, "gather": rsm_gather.METHODS}
    return tuple(methods.get(name or "", ()))


def bounce_method(name: str | None, method: object) -> str | None:
    """Return the method of a bounce that is asked for, or None for its default.

    Raises:
        ValueError: the bounce has no such method.
    """
    methods = bounce_methods(name)
    if method is None:
        return None
    if not methods:
        raise ValueError(f"method is {method!r}: expected None with indirect={name!r}, which has no methods")
    return checks.choice("method", method, methods)


def bounce_params(
    name: str | None, vpls: int, layers: int, radius: float, glossy_vpls: int = 0, method: str | None = None
) -> BounceParams | None:
    """Return the parameters of a bounce by its name, or None; `radius` is that of SSDO."""
    if name is None:
        return None
    if name == "multires" and method == "published":
        return MultiresPublishedParams(vpls=vpls)
    if name == "multires":
        # Shadow rays are shared by lights, which a hundredth would not show.
        return MultiresSplatParams(
            vpls=vpls, visibility=True, grid=MOST_CELLS, interpolation_error=0.05, light_error=0.05
        )
    if name == "ssdo":
        chosen: dict[str, Any] = {} if method is None else {"method": method}
        return SsdoParams(radius=radius, resolution="half", emission=False, **chosen)
    if name == "gather" and method == "published":
        return RsmPublishedParams()
    if name == "gather":
        return RsmGatherParams(resolution="adaptive")
    return VplSplatParams(
        vpls=vpls, glossy_vpls=glossy_vpls, cutoff=0.0, interleave=True, visibility=True, grid=MOST_CELLS
    )
