"""Parameters of a frame: one checked object for `render`, `Renderer`, the command line and the bench."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypedDict, get_args

import numpy as np

from ssgi_cl.core import checks
from ssgi_cl.core.names import All, AoTechnique, BounceMethod, Bounces, Curve, OneBounce, Preset
from ssgi_cl.core.params import Params, param, parameter_fields
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.constants import OCCUPANCY_MARGIN
from ssgi_cl.frame.skips import chosen_outputs, chosen_skips
from ssgi_cl.techniques.ao.occlusion import OcclusionParams
from ssgi_cl.techniques.catalogue import CATALOGUE, TECHNIQUES
from ssgi_cl.techniques.filters.tonemap import CURVES
from ssgi_cl.techniques.multires.multires_splat import MultiresSplatParams
from ssgi_cl.techniques.occupancy.occupancy_grid import MOST_CELLS
from ssgi_cl.techniques.rsm.rsm_gather import RsmGatherParams
from ssgi_cl.techniques.ssdo.ssdo_params import SsdoParams
from ssgi_cl.techniques.technique import Technique
from ssgi_cl.techniques.vpl.vpl_splat import VplSplatParams

AO_DEFAULT = "bitmask_ao"
AO_CONTACT = "gtao"
"""Techniques of ambient occlusion by default: of ambient light, and of contact in the whole picture."""
AO_SETTINGS = {"checkerboard": True, "blur_radius": 3, "taps": 16}
"""Of the first of them, which so takes half the time of its defaults for 1 to 3 % more error."""
MOST_BOUNCES = 1000
MOST_LAYERS = 16
MOST_PLACES = 64
EDGE_PLACES = 7
"""Places of a pixel at which visibility is tested in the whole picture."""
DEFAULT_PRESET = "high"

CONTACT = 2.0
"""Radius of ambient occlusion in the whole picture, cells of the occupancy grid: visibility rays miss blockers within
it, so that ambient occlusion stands in for them."""

BOUNCES: dict[str, Technique] = {
    name: CATALOGUE[technique]
    for name, technique in zip(get_args(OneBounce), ("multires_splat", "vpl_splat", "rsm_gather", "ssdo"), strict=True)
}
"""Techniques of one bounce by their name in `FrameParams.indirect`; the first is the default."""

BOUNCE_SETTINGS: dict[type[Params], dict[str, Any]] = {
    # Lights share shadow rays, which an error of .01 would not show.
    MultiresSplatParams: {"visibility": True, "grid": MOST_CELLS, "interpolation_error": 0.05, "light_error": 0.05},
    VplSplatParams: {"cutoff": 0.0, "interleave": True, "visibility": True, "grid": MOST_CELLS},
    RsmGatherParams: {"resolution": "adaptive"},
    SsdoParams: {"resolution": "half", "emission": False},
}
"""Settings of techniques of one bounce in frames, where they differ from the defaults of the technique."""


def _checked_bounces(bounces: object, low: int) -> int | str:
    if isinstance(bounces, str):
        return checks.choice("bounces", bounces, get_args(All))
    return checks.integer("bounces", bounces, low=low, high=MOST_BOUNCES, unit="reflections")


@dataclass(frozen=True, kw_only=True)
class WholeFrameParams(Params):
    """Accuracy of the whole picture; `low`, `medium`, `high` and `ultra` are presets."""

    bounces: Bounces = param("all", "reflections on the way from a light to a pixel: 1 or more, or 'all'")
    vpls: int = param(8192, "virtual point lights for the first bounce of punctual lights", low=16, high=1 << 16)
    surfels: int = param(2048, "surface elements that carry all other light", low=16, high=1 << 14)
    rays: int = param(
        144,
        "over the hemisphere of each point of the coarsest level at which light of surfels is gathered, about; in "
        "scenes without holes",
        low=4,
        high=4096,
    )
    directions: int = param(256, "sampled directions of environments", low=16, high=4096)
    map_size: int = param(128, "along the side of the depth map of each direction", low=16, high=1024, unit="texels")
    error: float = param(
        0.15,
        "of the final gather's light tree and interpolation, of the latter .3 times that where rays gather",
        low=0.0,
        high=1e6,
        unit="of the mean irradiance by all light, direct and sky light included",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        _checked_bounces(self.bounces, 1)

    @classmethod
    def low(cls, bounces: Bounces = "all") -> WholeFrameParams:
        """Return the fastest preset."""
        return cls(vpls=1024, surfels=512, rays=25, directions=64, error=0.2, bounces=bounces)

    @classmethod
    def medium(cls, bounces: Bounces = "all") -> WholeFrameParams:
        """Return the preset between `low` and `high`."""
        return cls(vpls=2048, surfels=1024, rays=64, directions=128, bounces=bounces)

    @classmethod
    def high(cls, bounces: Bounces = "all") -> WholeFrameParams:
        """Return the default preset."""
        return cls(bounces=bounces)

    @classmethod
    def ultra(cls, bounces: Bounces = "all") -> WholeFrameParams:
        """Return the most exact preset."""
        return cls(vpls=16384, surfels=8192, rays=1024, directions=512, map_size=256, error=0.02, bounces=bounces)


PRESETS = {name: getattr(WholeFrameParams, name) for name in get_args(Preset)}
"""Constructor of each preset by name, from the fastest to the most exact."""


@dataclass(frozen=True, kw_only=True)
class FrameParams(Params):
    """Parameters of a frame; see `render` for what they mean together.

    `ao` and `indirect` may be parameters of a technique in place of its name, and `preset` a
    `WholeFrameParams`: such parameters are taken as they are.
    """

    bounces: Bounces | None = param(None, "reflections: 0 or more, or 'all'; None: 'all' without `indirect`, else 0")
    preset: Preset | WholeFrameParams | None = param(None, "accuracy of the whole picture; None: 'high'")
    ao: bool | AoTechnique | OcclusionParams = param(
        True, "technique of ambient occlusion; True: 'bitmask_ao', in the whole picture 'gtao'"
    )
    ao_radius: float | None = param(
        None, "of ambient occlusion and of 'ssdo'; None: chosen from the view", unit="scene units"
    )
    ao_samples: int | None = param(None, "points per pixel of 'ssao'")
    multi_bounce: bool = param(False, "whether ambient occlusion counts light that surfaces reflect")
    indirect: bool | OneBounce | Params | None = param(None, "one bounce of light in place of all; True: 'multires'")
    method: BounceMethod | None = param(None, "method of `indirect`; None: its default")
    vpls: int = param(1024, "virtual point lights of 'multires' and 'vpl'", low=1, high=1 << 24)
    glossy_vpls: int = param(0, "more lights of 'vpl', for what glossy surfaces mirror", low=0, high=1 << 24)
    indirect_ao: bool = param(False, "whether ambient occlusion dims reflected light too")
    layers: int = param(1, "depth layers of the G-buffer", low=1, high=MOST_LAYERS)
    overscan: float = param(
        0.0, "margin of the G-buffer on every side", low=0.0, high=1.0, unit="share of the image's size"
    )
    auxiliary_cameras: int = param(0, "of 'ssdo', for surfaces that the camera misses", low=0, high=64)
    edges: int | None = param(None, "places of each pixel that smooth edges; None: 7 in the whole picture, else 0")
    shadow_size: int = param(1024, "along the side of each shadow map", low=16, high=8192, unit="texels")
    rsm_size: int = param(
        512, "along a side that reflected light is chosen from, at most", low=16, high=8192, unit="texels"
    )
    exposure: float | None = param(None, "factor before the tone curve; None: automatic")
    curve: Curve = param("filmic", "of tones", choices=CURVES)
    gbuffer: bool = param(False, "whether the frame holds the G-buffer too")
    outputs: Iterable[str] | None = param(None, "names of what the frame is to hold; None: the picture")
    skips: frozenset[str] = param(True, "names of work that may be left out; True: all, False: none")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.bounces is not None:
            self._set("bounces", _checked_bounces(self.bounces, 0))
        self._set("outputs", chosen_outputs(self.outputs))
        self._set("skips", chosen_skips(self.skips))
        if self.edges is not None:
            self._set("edges", checks.integer("edges", self.edges, low=0, high=MOST_PLACES, unit="places"))
        if self.exposure is not None:
            self._set("exposure", checks.number("exposure", self.exposure, low=0.0, above=True))
        self._check_light()

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def _check_light(self) -> None:
        """Raise unless the parameters of light go together."""
        whole, dims, name = self.whole, self.ao_name, self.bounce_name
        methods = bounce_methods(name)
        if self.method is not None and not methods:
            raise ValueError(f"method is {self.method!r}: expected None with indirect={name!r}, which has no methods")
        if self.method is not None:
            checks.choice("method", self.method, methods)
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
                raise ValueError(
                    f"{argument} is {value!r}: expected 0 with indirect={name!r}, they apply to {of!r} only"
                )

    @cached_property
    def whole(self) -> WholeFrameParams | None:
        """Parameters of the whole picture; None of a frame with at most one bounce."""
        bounces, preset, indirect = self.bounces, self.preset, self.indirect
        if not isinstance(preset, WholeFrameParams):
            name = DEFAULT_PRESET if preset is None else checks.choice("preset", preset, tuple(PRESETS))
        if bounces and indirect is not None and indirect is not False:
            raise ValueError(
                f"bounces is {bounces!r}: expected None or 0 with indirect={indirect!r}, which "
                "reflects light once by itself"
            )
        if bounces == 0 or (bounces is None and indirect is not None):
            if preset is not None:
                raise ValueError(
                    f"preset is {preset!r}: expected None without bounces; it applies to the whole picture only"
                )
            return None
        if isinstance(preset, WholeFrameParams):
            return preset if bounces is None else replace(preset, bounces=bounces)
        found: WholeFrameParams = PRESETS[name]("all" if bounces is None else bounces)
        return found

    @cached_property
    def ao_name(self) -> str | None:
        """Name of the technique that dims ambient light, or None."""
        if isinstance(self.ao, Params):
            return next(name for name, entry in TECHNIQUES.items() if type(self.ao) is entry.params)
        if not isinstance(self.ao, (bool, str)):
            raise TypeError(f"ao is {self.ao!r}: expected True, False or the name of a technique")
        usual = AO_DEFAULT if self.whole is None else AO_CONTACT
        name = usual if self.ao is True else self.ao
        if isinstance(name, str):
            checks.choice("ao", name, tuple(TECHNIQUES))
        if self.ao_samples is not None and name != "ssao":
            raise ValueError(f"ao_samples is {self.ao_samples}: expected None with ao={self.ao!r}, it is of 'ssao'")
        return name or None

    @cached_property
    def bounce_name(self) -> str | None:
        """Name of the technique of one bounce, or None."""
        indirect = self.indirect
        if isinstance(indirect, Params):
            kinds = {name: (each.params, *each.methods.values()) for name, each in BOUNCES.items()}
            return next(name for name, params in kinds.items() if isinstance(indirect, params))
        if isinstance(indirect, bool):
            return next(iter(BOUNCES)) if indirect else None
        if indirect is not None and not isinstance(indirect, str):
            raise TypeError(f"indirect is {indirect!r}: expected True, False, None or the name of a technique")
        return None if indirect is None else checks.choice("indirect", indirect, tuple(BOUNCES))

    @property
    def kind(self) -> str:
        """The kind of frame: "whole", "direct", "one bounce" or "ssdo"."""
        if self.whole is not None:
            return "whole"
        name = self.bounce_name
        return "direct" if name is None else "ssdo" if name == "ssdo" else "one bounce"

    @property
    def edge_places(self) -> int:
        """Places of a pixel at which visibility is tested, 0 where centres alone count."""
        if self.edges is not None:
            return self.edges
        return EDGE_PLACES if self.kind == "whole" else 0

    @property
    def dims_indirect(self) -> bool:
        """Whether ambient occlusion dims reflected light."""
        return self.indirect_ao and self.kind in ("whole", "one bounce")

    @property
    def draws_thickness(self) -> bool:
        """Whether the G-buffer gets the ends of solids, which ambient occlusion reads where it has its full radius."""
        return self.kind in ("direct", "one bounce") and self.ao_name == "bitmask_ao"

    @property
    def needs_radius(self) -> bool:
        """Whether a radius is to be chosen from the view."""
        # With SSDO there is no other occlusion; parameters of a technique have a radius of their own.
        technique = self.indirect if self.bounce_name == "ssdo" else self.ao if self.ao_name else None
        return self.ao_radius is None and technique is not None and not isinstance(technique, Params)

    def techniques(self, radius: float = 1.0) -> tuple[OcclusionParams | None, Any]:
        """Return the parameters of ambient occlusion and of one bounce, None where there is none.

        `radius` is theirs where `ao_radius` is None. Their shape does not depend on it.
        """
        radius = radius if self.ao_radius is None else self.ao_radius
        bounce = self.indirect if isinstance(self.indirect, Params) else self._bounce(radius)
        if isinstance(bounce, SsdoParams):
            return None, replace(bounce, bent_normals=False)  # a picture has none
        occlusion: Any = self.ao
        if not isinstance(occlusion, Params):
            given = {} if self.ao_samples is None else {"samples": self.ao_samples}
            if self.ao is True and self.ao_name == AO_DEFAULT:
                given = AO_SETTINGS
            occlusion = self.ao_name and TECHNIQUES[self.ao_name].params(radius=radius, **given)
        return occlusion, bounce

    def _bounce(self, radius: float) -> Params | None:
        if self.bounce_name is None:
            return None
        technique = BOUNCES[self.bounce_name]
        kind = technique.methods.get(self.method or "", technique.params)
        own = parameter_fields(kind)
        values: dict[str, Any] = {name: getattr(self, name) for name in ("vpls", "glossy_vpls") if name in own}
        if kind is SsdoParams:
            values |= {"radius": radius} | ({} if self.method is None else {"method": self.method})
        return kind(**values, **BOUNCE_SETTINGS.get(kind, {}))

    def margin(self, size: Size) -> Size:
        """Return (rows, columns) by which the G-buffer exceeds pictures of `size` on every side."""
        return math.ceil(self.overscan * size[0]), math.ceil(self.overscan * size[1])

    def shape(self) -> Hashable:
        """Return all that a renderer is prepared for."""
        techniques = (None if each is None else each.shape() for each in self.techniques())
        sizes = self.layers, self.overscan, self.auxiliary_cameras, self.shadow_size, self.rsm_size
        return self.whole, *techniques, *sizes, self.curve, self.indirect_ao, self.skips, self.edge_places


class FrameKeywords(TypedDict, total=False):
    """`FrameParams` as keyword arguments."""

    bounces: Bounces | None
    preset: Preset | WholeFrameParams | None
    ao: bool | AoTechnique | OcclusionParams
    ao_radius: float | None
    ao_samples: int | None
    multi_bounce: bool
    indirect: bool | OneBounce | Params | None
    method: BounceMethod | None
    vpls: int
    glossy_vpls: int
    indirect_ao: bool
    layers: int
    overscan: float
    auxiliary_cameras: int
    edges: int | None
    shadow_size: int
    rsm_size: int
    exposure: float | None
    curve: Curve
    gbuffer: bool
    outputs: Iterable[str] | None
    skips: bool | Iterable[str]


def bounce_methods(name: str | None) -> tuple[str, ...]:
    """Return the methods of a technique of one bounce; none where there is one way to compute it."""
    return () if name is None else tuple(BOUNCES[name].methods)


def cell_size(scene: Scene) -> float:
    """Return the side of a cell of the occupancy grid that holds a scene, scene units."""
    return float(np.ptp(scene.bounds, axis=0).max() or 1.0) / (MOST_CELLS - OCCUPANCY_MARGIN)
