"""Parameters of a frame: one checked object for `render`, `Renderer`, the command line and the bench."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ssgi_cl.core import checks
from ssgi_cl.core.params import Params, param
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.constants import OCCUPANCY_MARGIN
from ssgi_cl.frame.skips import Needs, chosen_skips
from ssgi_cl.techniques.ao.occlusion import OcclusionParams
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.filters.tonemap import CURVES
from ssgi_cl.techniques.multires import multires_splat
from ssgi_cl.techniques.multires.multires_published import MultiresPublishedParams
from ssgi_cl.techniques.multires.multires_splat import MultiresSplatParams
from ssgi_cl.techniques.occupancy.occupancy_grid import MOST_CELLS
from ssgi_cl.techniques.rsm import rsm_gather
from ssgi_cl.techniques.rsm.rsm_gather import RsmGatherParams
from ssgi_cl.techniques.rsm.rsm_published import RsmPublishedParams
from ssgi_cl.techniques.ssdo.ssdo_params import SsdoParams
from ssgi_cl.techniques.vpl.vpl_splat import VplSplatParams

AO_DEFAULT = "gtao"
BOUNCES = ("multires", "vpl", "gather", "ssdo")
"""The first is the default of one bounce."""
MOST_BOUNCES = 1000
MOST_LAYERS = 16
DEFAULT_PRESET = "high"

CONTACT = 2.0
"""Cells of the occupancy grid within which visibility rays miss what blocks them: ambient occlusion
of that radius stands in for them, of the sky's light, and in gaps of the bounces too."""

OneBounceParams = MultiresSplatParams | MultiresPublishedParams | VplSplatParams | RsmGatherParams | RsmPublishedParams
BounceParams = OneBounceParams | SsdoParams


@dataclass(frozen=True, kw_only=True)
class WholeFrameParams(Params):
    """How exactly all light is computed; `low`, `medium`, `high` and `ultra` are presets."""

    bounces: int | str = param("all", "reflections on the way from a light to a pixel: 1 or more, or 'all'")
    vpls: int = param(4096, "virtual point lights for the first bounce of punctual lights", low=16, high=1 << 16)
    surfels: int = param(2048, "pieces of surfaces that carry all other light", low=16, high=1 << 14)
    directions: int = param(128, "that stand for environments", low=16, high=4096)
    map_size: int = param(128, "along the side of the depth map of each direction", low=16, high=1024, unit="texels")
    error: float = param(
        0.15,
        "of the final gather's interpolation and light tree",
        low=0.0,
        high=1e6,
        unit="of the mean irradiance by all light, direct and sky light included",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bounces != "all":
            checks.integer("bounces", self.bounces, low=1, high=MOST_BOUNCES, unit="reflections")

    @classmethod
    def low(cls, bounces: int | str = "all") -> WholeFrameParams:
        """Return the fastest preset."""
        return cls(vpls=1024, surfels=512, directions=64, error=0.2, bounces=bounces)

    @classmethod
    def medium(cls, bounces: int | str = "all") -> WholeFrameParams:
        """Return the preset between `low` and `high`."""
        return cls(vpls=2048, surfels=1024, bounces=bounces)

    @classmethod
    def high(cls, bounces: int | str = "all") -> WholeFrameParams:
        """Return the default preset."""
        return cls(bounces=bounces)

    @classmethod
    def ultra(cls, bounces: int | str = "all") -> WholeFrameParams:
        """Return the most exact preset."""
        return cls(vpls=16384, surfels=8192, directions=256, map_size=256, error=0.02, bounces=bounces)


PRESETS = {name: getattr(WholeFrameParams, name) for name in ("low", "medium", "high", "ultra")}
"""By name, from the fastest to the most exact -> what returns it."""


@dataclass(frozen=True, kw_only=True)
class FrameParams(Params):
    """Parameters of a frame; see `render` for what they mean together.

    `ao` and `indirect` may be parameters of a technique in place of its name, and `preset` a
    `WholeFrameParams`: such parameters are taken as they are.
    """

    bounces: int | str | None = param(None, "reflections: 0 or more, or 'all'; None: 'all' without `indirect`, else 0")
    preset: str | WholeFrameParams | None = param(None, "how exactly all bounces are computed; None: 'high'")  # noqa: RUF009
    ao: bool | str | OcclusionParams = param(True, "what dims ambient light; True: 'gtao'")  # noqa: RUF009
    ao_radius: float | None = param(
        None, "of ambient occlusion and of 'ssdo'; None: chosen from the view", unit="scene units"
    )
    ao_samples: int | None = param(None, "points per pixel of 'ssao'")
    multi_bounce: bool = param(False, "whether ambient occlusion counts light that surfaces reflect")
    indirect: bool | str | BounceParams | None = param(None, "one bounce of light in place of all; True: 'multires'")  # noqa: RUF009
    method: str | None = param(None, "how `indirect` is computed; None: its default")
    vpls: int = param(1024, "virtual point lights of 'multires' and 'vpl'", low=1, high=1 << 24)
    glossy_vpls: int = param(0, "more lights of 'vpl', for what glossy surfaces mirror", low=0, high=1 << 24)
    indirect_ao: bool = param(False, "whether ambient occlusion dims reflected light too")
    layers: int = param(1, "depth layers of the G-buffer", low=1, high=MOST_LAYERS)
    overscan: float = param(
        0.0, "margin of the G-buffer on every side", low=0.0, high=1.0, unit="share of the image's size"
    )
    auxiliary_cameras: int = param(0, "that show 'ssdo' what the camera misses", low=0, high=64)
    shadow_size: int = param(1024, "along the side of each shadow map", low=16, high=8192, unit="texels")
    rsm_size: int = param(
        512, "along a side that reflected light is chosen from, at most", low=16, high=8192, unit="texels"
    )
    exposure: float | None = param(None, "factor before the tone curve; None: automatic")
    curve: str = param("filmic", "of tones", choices=tuple(CURVES))
    gbuffer: bool = param(False, "whether the frame holds the G-buffer too")
    outputs: Iterable[str] | None = param(None, "what the frame is to hold; None: the picture")
    skips: frozenset[str] = param(True, "what may be left out; True: all")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.outputs is not None and not isinstance(self.outputs, str):  # which is refused below
            self._set("outputs", tuple(self.outputs))
        self._set("skips", chosen_skips(self.skips))
        Needs.of(self.outputs, self.skips)
        if self.exposure is not None:
            self._set("exposure", checks.number("exposure", self.exposure, low=0.0, above=True))
        self._check_light()

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def _check_light(self) -> None:
        """Raise unless the parameters of light go together."""
        whole, dims, name = self.whole(), self.ao_name, self.bounce_name
        bounce_method(name, self.method)
        if self.multi_bounce and name == "ssdo":
            raise ValueError("multi_bounce is True: expected False with indirect='ssdo', it is of ao")
        if self.indirect_ao and whole is None and (dims is None or name in (None, "ssdo")):
            raise ValueError(
                f"indirect_ao is True: expected False with ao={self.ao!r} and indirect={name!r}, it "
                "needs ambient occlusion and the bounce of lights"
            )
        for argument, of in (("glossy_vpls", "vpl"), ("auxiliary_cameras", "ssdo")):
            value = getattr(self, argument)
            if value and name != of:
                only = "they are of 'vpl'" if of == "vpl" else "they apply to 'ssdo' only"
                raise ValueError(f"{argument} is {value!r}: expected 0 with indirect={name!r}, {only}")

    @property
    def kind(self) -> str:
        """The kind of frame: "whole", "direct", "one bounce" or "ssdo"."""
        if self.whole() is not None:
            return "whole"
        name = self.bounce_name
        return "direct" if name is None else "ssdo" if name == "ssdo" else "one bounce"

    @property
    def ao_name(self) -> str | None:
        """The name of the technique that dims ambient light, or None."""
        if isinstance(self.ao, Params):
            return next(name for name, entry in TECHNIQUES.items() if type(self.ao) is entry.params)
        return ao_name(self.ao, self.ao_samples)

    @property
    def bounce_name(self) -> str | None:
        """How one bounce of light is found, or None."""
        if isinstance(self.indirect, Params):
            return next(name for name in BOUNCES if isinstance(self.indirect, BOUNCE_PARAMS[name]))
        return bounce_name(self.indirect)

    @property
    def dims_indirect(self) -> bool:
        """Whether ambient occlusion dims reflected light."""
        return self.indirect_ao and self.kind in ("whole", "one bounce")

    def whole(self) -> WholeFrameParams | None:
        """Return how all bounces are computed; None where the frame has not all light."""
        return whole_params(self.bounces, self.preset, self.indirect)

    def whole_params(self) -> WholeFrameParams:
        """Return how all bounces are computed, in a frame that has them."""
        found = self.whole()
        assert found is not None  # noqa: S101  asked for in whole frames alone
        return found

    def margin(self, size: Size) -> Size:
        """Return (rows, columns) by which the G-buffer exceeds pictures of `size` on every side."""
        return math.ceil(self.overscan * size[0]), math.ceil(self.overscan * size[1])

    @property
    def needs_radius(self) -> bool:
        """Whether a radius is to be chosen from the view."""
        of_view = self.bounce_name == "ssdo" or (self.ao_name is not None and not isinstance(self.ao, Params))
        return self.ao_radius is None and of_view

    def techniques(self, radius: float) -> tuple[OcclusionParams | None, BounceParams | None]:
        """Return parameters of ambient occlusion and of one bounce; `radius` where none is given."""
        radius = radius if self.ao_radius is None else self.ao_radius
        name, dims = self.bounce_name, self.ao_name
        bounce: Any = self.indirect
        if not isinstance(bounce, Params):
            bounce = bounce_params(name, self.vpls, self.layers, radius, self.glossy_vpls, self.method)
        if name == "ssdo":
            return None, replace(bounce, bent_normals=False)  # a picture has none
        occlusion: Any = self.ao
        if not isinstance(occlusion, Params):
            samples = {} if self.ao_samples is None else {"samples": self.ao_samples}
            occlusion = None if dims is None else TECHNIQUES[dims].params(radius=radius, **samples)
        return occlusion, bounce

    def shape(self) -> Hashable:
        """Return all that a renderer is prepared for."""
        occlusion, bounce = (None if each is None else each.shape() for each in self.techniques(1.0))
        names = (
            "layers overscan auxiliary_cameras shadow_size rsm_size curve indirect_ao skips".split()  # noqa: SIM905
        )
        return self.whole(), occlusion, bounce, *(getattr(self, name) for name in names)


BOUNCE_PARAMS: dict[str, tuple[type, ...]] = {
    "multires": (MultiresSplatParams, MultiresPublishedParams),
    "vpl": (VplSplatParams,),
    "gather": (RsmGatherParams, RsmPublishedParams),
    "ssdo": (SsdoParams,),
}
"""Name of a bounce -> its kinds of parameters."""


def whole_params(bounces: object, preset: object, indirect: object) -> WholeFrameParams | None:
    """Return what is asked for by these arguments of `render`; None without the whole picture.

    Raises:
        TypeError, ValueError: a wrong one, or two that exclude each other.
    """
    if isinstance(bounces, str):
        checks.choice("bounces", bounces, ("all",))
    elif bounces is not None:
        bounces = checks.integer("bounces", bounces, low=0, high=MOST_BOUNCES, unit="reflections")
    if not isinstance(preset, WholeFrameParams):
        name = DEFAULT_PRESET if preset is None else checks.choice("preset", preset, tuple(PRESETS))
    technique = indirect is not None and indirect is not False
    if technique and bounces:
        raise ValueError(
            f"bounces is {bounces!r}: expected None or 0 with indirect={indirect!r}, which "
            "reflects light once by itself"
        )
    if bounces == 0 or (bounces is None and (technique or indirect is False)):
        if preset is not None:
            raise ValueError(
                f"preset is {preset!r}: expected None without bounces; it applies to the whole picture only"
            )
        return None
    if isinstance(preset, WholeFrameParams):
        return preset if bounces is None else replace(preset, bounces=bounces)
    found: WholeFrameParams = PRESETS[name]("all" if bounces is None else bounces)
    return found


def cell_size(scene: Scene) -> float:
    """Return the side of a cell of the occupancy grid that holds a scene, scene units."""
    return float(np.ptp(scene.bounds, axis=0).max() or 1.0) / (MOST_CELLS - OCCUPANCY_MARGIN)


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
