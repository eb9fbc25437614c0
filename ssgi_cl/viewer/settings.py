"""The parameters that a tab changes: values by group and name, made into checked parameters of a frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ssgi_cl.core import checks
from ssgi_cl.core.params import Params, parameter_fields
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.techniques.ao.occlusion import OcclusionParams

FRAME, PRESET, AO, BOUNCE = "frame", "preset", "ao", "bounce"
"""Groups of parameters: of the frame, of the whole picture's accuracy, and of the techniques that it uses."""

TITLES = {FRAME: "Frame", PRESET: "Whole picture", AO: "Ambient occlusion: {}", BOUNCE: "One bounce: {}"}
"""Of each group; {} stands for the technique's name."""

_ONE_BOUNCE = ("indirect", "method", "glossy_vpls", "auxiliary_cameras", "indirect_ao")
_OTHERS: dict[tuple[str, str], tuple[tuple[str, tuple[str, ...]], ...]] = {
    (FRAME, "indirect"): ((FRAME, ("bounces", "preset", *_ONE_BOUNCE)), (AO, ()), (BOUNCE, ()), (PRESET, ())),
    (FRAME, "method"): ((BOUNCE, ()),),
    (FRAME, "bounces"): ((FRAME, _ONE_BOUNCE), (AO, ()), (BOUNCE, ())),
    (FRAME, "preset"): ((FRAME, ("bounces", *_ONE_BOUNCE)), (AO, ()), (PRESET, ())),
    (FRAME, "ao"): ((FRAME, ("ao_samples",)), (AO, ())),
}
"""(group, name) of what is chosen -> what goes back to its default then: (group, names), all where none are named."""


@dataclass(frozen=True, eq=False)
class Settings:
    """Values of parameters by group and name; all others have their defaults.

    Attributes:
        radius: of ambient occlusion where none is given and a technique's own parameters are, scene units.
        values: group -> name -> value.
    """

    radius: float
    values: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def params(self) -> FrameParams:
        """The parameters of a frame.

        Raises:
            TypeError, ValueError: a value out of its range, or two that exclude each other.
        """
        base = self._base
        changes: dict[str, Any] = {}
        for group, name in ((PRESET, "preset"), (AO, "ao"), (BOUNCE, "indirect")):
            given = self.values.get(group)
            if given:
                current = self.of(group)
                if current is not None:  # else kept for when the frame has such again
                    changes[name] = replace(current, **given)  # type: ignore[type-var]
        return replace(base, **changes) if changes else base

    @property
    def _base(self) -> FrameParams:
        return FrameParams(**self.values.get(FRAME, {}))

    def of(self, group: str) -> Params | None:
        """Return the parameters of a group before its own values; None where the frame has none such."""
        base = self._base
        if group == FRAME:
            return base
        if group == PRESET:
            return base.whole
        occlusion, bounce = base.techniques(self.radius)
        found: Params | None = occlusion if group == AO else bounce
        return found

    def current(self, group: str) -> Params | None:
        """Return the parameters of a group with its own values."""
        found = self.of(group)
        given = self.values.get(group)
        return found if found is None or not given else replace(found, **given)  # type: ignore[type-var]

    def title(self, group: str) -> str:
        """Return the heading of a group."""
        base = self._base
        return TITLES[group].format(base.ao_name if group == AO else base.bounce_name)

    def changed(self, group: str, name: str, value: Any) -> Settings:
        """Return these settings with another value; what it excludes goes back to its default.

        Raises:
            TypeError, ValueError: a value out of its range, or there is no such parameter.
        """
        kind = self.of(group)
        if kind is None or name not in parameter_fields(type(kind)):
            raise ValueError(f"{name} is {value!r}: the frame has no such parameter in {group!r}")
        values = {key: dict(each) for key, each in self.values.items()}
        for other, names in _OTHERS.get((group, name), ()):
            of = values.get(other, {})
            for gone in names or tuple(of):
                of.pop(gone, None)
        if group == FRAME and name == "bounces" and value == 0:
            values.get(FRAME, {}).pop("preset", None)
            values.pop(PRESET, None)
        values.setdefault(group, {})[name] = value
        found = Settings(self.radius, values)
        _ = found.params  # checked here, where the message still has its place
        return found


def check_share(value: float) -> float:
    """Return the place of the wipe, in [0, 1]."""
    return checks.number("wipe", value, low=0.0, high=1.0, unit="share of the picture's width")


def direct_params(params: FrameParams) -> FrameParams:
    """Return the parameters of a frame without reflected light."""
    values: dict[str, Any] = {"bounces": 0, "preset": None, "indirect": None, "method": None, "indirect_ao": False}
    return replace(params, **values, glossy_vpls=0, auxiliary_cameras=0)


def occlusion_of(params: FrameParams, radius: float) -> OcclusionParams | None:
    """Return the parameters of a frame's ambient occlusion; `radius` (scene units) where it has none of its own."""
    return params.techniques(radius)[0]
