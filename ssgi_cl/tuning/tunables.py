"""Tunable parameters and views: names and ranges as a caller gives them, checked."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ssgi_cl.core import checks
from ssgi_cl.core.params import Params
from ssgi_cl.rasterize.scenes import REPORTED, TUNED_ON, VALIDATED_ON, BuiltinScene, make_scene
from ssgi_cl.techniques.catalogue import TECHNIQUES
from ssgi_cl.techniques.technique import Technique
from ssgi_cl.truth.digests import scene_digest
from ssgi_cl.tuning.search import Axis


def entry_of(technique: str) -> Technique:
    """Return a technique's entry; ValueError names those that exist."""
    return TECHNIQUES[checks.choice("technique", technique, sorted(TECHNIQUES))]


def views_of(scenes: Sequence[str | BuiltinScene] | None) -> list[BuiltinScene]:
    """Return all views of the scenes of `tune`'s argument; of `TUNED_ON` the first of each.

    Raises:
        ValueError: a name is unknown, or of a scene for validation or one that errors are reported
            on.
    """
    if isinstance(scenes, (str, BuiltinScene)):
        raise TypeError(f"scenes is {scenes!r}: expected a list of names or scenes")
    if scenes is None:
        return [make_scene(name).views()[0] for name in TUNED_ON]
    result: list[BuiltinScene] = []
    for scene in scenes:
        if isinstance(scene, str):
            kept = {
                **dict.fromkeys(REPORTED, "on which errors are reported"),
                **dict.fromkeys(VALIDATED_ON, "which is for validation"),
            }
            if scene in kept:
                raise ValueError(
                    f"scene is {scene!r}, {kept[scene]}: expected another, such as "
                    f"{', '.join(TUNED_ON[:3])}, or the scene itself, make_scene({scene!r})"
                )
            scene = make_scene(scene)
        result += scene.views()
    if not result:
        raise ValueError("scenes is empty: expected at least one")
    return result


def axis_of(params: type[Params], name: str, values: Sequence[Any]) -> Axis:
    """Return the axis of a parameter; the declaration in `params` says what is allowed.

    Raises:
        ValueError: there is no such parameter, or a value is not allowed.
    """
    fields = {field.name: field for field in dataclasses.fields(params)}  # type: ignore[arg-type]
    varied = sorted(set(fields) - {"radius"})
    if name not in varied:
        raise ValueError(f"parameters has {name!r}: expected one of {', '.join(varied)}")
    if isinstance(values, str) or not isinstance(values, Sequence) or not values:
        raise ValueError(f"{name} is {values!r}: expected (low, high) or a list of values")
    default = fields[name].default
    is_range = (
        isinstance(values, tuple) and len(values) == 2 and not any(isinstance(value, (bool, str)) for value in values)
    )
    if not is_range:
        options = tuple(values)
        axis = Axis(name, values=options)
        return replace(axis, values=tuple(sorted(options))) if axis.ordered else axis
    low, high = (checks.number(name, value) for value in values)
    if not low < high:
        raise ValueError(f"{name} is {values!r}: expected (low, high) with low < high")
    rule = fields[name].metadata
    if low < rule["low"] or high > rule["high"]:
        raise ValueError(f"{name} is {values!r}: expected a range within [{rule['low']:g}, {rule['high']:g}]")
    return Axis(name, low, high, whole=isinstance(default, int) and not isinstance(default, bool))


def within(axis: Axis, value: Any) -> Any:
    """Return the value of the axis that is nearest to `value`; the first of those without order."""
    if axis.values and not axis.ordered and value not in axis.values:
        return axis.values[0]
    if axis.values and value in axis.values:
        return value
    if not axis.values and axis.low <= value <= axis.high:
        return value
    return axis.at(axis.place(value) if axis.values else float(value > axis.high))


def described(views: Sequence[BuiltinScene], radius: float | None = None) -> list[dict[str, Any]]:
    """Return name, digest, radius and views of each scene, as records have them.

    Args:
        views: of the scenes; those of one scene make one entry.
        radius: in place of the scenes' own.
    """
    scenes: dict[int, dict[str, Any]] = {}
    for view in views:
        if id(view.scene) not in scenes:
            own = view.ao_radius if radius is None else radius
            scenes[id(view.scene)] = {"name": view.name, "digest": scene_digest(view.scene), "radius": own, "views": []}
        scenes[id(view.scene)]["views"].append({"eye": list(view.eye), "target": list(view.target)})
    return list(scenes.values())
