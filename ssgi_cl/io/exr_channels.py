"""Quantities of the channels of an OpenEXR file: depth, normal, albedo and emission by their names, layer by layer.

A channel's name is layers, a quantity and a component, separated by dots: "ViewLayer.Normal.X". Programs
differ in case, in spaces and underscores, in what they call a quantity, and in whether they write the last
dot ("Nx"). The names are those of Blender, Arnold, V-Ray, Redshift, Karma, RenderMan, Unreal's Movie Render
Queue and Nuke, and of files in public reports.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import NamedTuple

QUANTITIES: dict[str, tuple[str, ...]] = {
    "depth": ("z", "depth", "zdepth", "worlddepth", "scenedepth", "lineardepth", "dd", "hitdist", "denoisingdepth"),
    "normal": (
        "n", "normal", "normals", "ns", "nn", "hitn", "worldnormal", "worldnormals", "nworld", "shadingnormal",
        "shnormal", "denoisingnormal",
    ),
    "albedo": ("albedo", "diffusealbedo", "diffcol", "diffusecolor", "basecolor", "diffusefilter", "denoisingalbedo"),
    "emission": ("emission", "emit", "selfillum", "selfillumination"),
}  # fmt: skip
"""Names of each quantity without case, spaces and underscores, the first preferred."""

POSITIONS = ("p", "hitp", "position")
"""Names of positions, whose third component is a depth where there is no other."""

_TRIPLES = ("XYZ", "RGB")
_OF_DEPTH = "ZRVYTX"
"""Components of a depth, the first preferred."""
_WITHOUT_DOT = re.compile(r"^(N|Ns|Nn|hitN|normal|P|hitP)([xyz])$", re.IGNORECASE)


class Found(NamedTuple):
    """Channels of the quantities that a file has in the layer that is read.

    Attributes:
        layer: its name; "" for channels outside of layers.
        channels: names by quantity, one of depth and three of others.
        notes: what was read, and what was not, in words.
    """

    layer: str
    channels: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...]


class AmbiguousLayerError(ValueError):
    """Several layers have a depth; the message lists them."""


def found_channels(
    names: Iterable[str],
    layer: str | None = None,
    given: Mapping[str, tuple[str, ...]] | None = None,
    first: Mapping[str, tuple[str, ...]] | None = None,
) -> Found:
    """Return the channels of a G-buffer among the names of a file.

    Args:
        names: of all channels.
        layer: whose quantities to read. By default the one with a depth; of several, that with the most
            quantities.
        given: channels of quantities that are known already.
        first: names of quantities that are preferred to those of `QUANTITIES`.

    Raises:
        ValueError: no layer of this name has a depth, or none at all has.
        AmbiguousLayerError: several layers have as many quantities.
    """
    names = tuple(names)
    layers, given = _by_layer(names, first or {}), given or {}
    if "depth" in given:
        holding = (name for name, found in layers.items() if any(given["depth"][0] in part for part in found.values()))
        own = next(holding, channel_parts(given["depth"][0])[0])
        layers.setdefault(own, {})["depth"] = given["depth"]
        layer = own if layer is None else layer
    deep = {name: found for name, found in layers.items() if "depth" in found}
    if layer is not None:
        if layer not in deep:
            raise ValueError(f"layer is {layer!r}: expected one with a depth, which are {_listed(deep) or 'none'}")
        chosen = layer
    elif not deep:
        raise ValueError(f"no depth channel; it has {', '.join(sorted(names)) or 'none'}")
    else:
        most = max(len(found) for found in deep.values())
        full = [name for name, found in deep.items() if len(found) == most]
        if len(full) > 1:
            raise AmbiguousLayerError(
                f"layers {_listed(full)} have a depth each: say which is to be read, by layer= or by channels="
            )
        (chosen,) = full
    channels = {**deep[chosen], **given}
    for quantity in QUANTITIES:  # of layers that are no view of their own
        others = [found[quantity] for name, found in layers.items() if quantity in found and name not in deep]
        if quantity not in channels and len(others) == 1:
            channels[quantity] = others[0]
    read = {name for part in channels.values() for name in part}
    notes = [f"{quantity} is read from {', '.join(part)}" for quantity, part in channels.items()]
    if unread := [name for name in names if name not in read]:
        notes.append(f"not read: {', '.join(unread)}")
    return Found(chosen, channels, tuple(notes))


def _by_layer(names: tuple[str, ...], first: Mapping[str, tuple[str, ...]]) -> dict[str, dict[str, tuple[str, ...]]]:
    """Return the channels of each quantity by layer."""
    stems: dict[tuple[str, str], dict[str, str]] = {}  # (layer, stem) -> component -> name
    for name in names:
        layer, stem, component = channel_parts(name)
        stems.setdefault((layer, stem), {})[component] = name
    for (layer, stem), components in tuple(stems.items()):  # "left.Z"
        if components.keys() == {"Z"} and not tuple(_meanings(stem, first, alone=False)):
            name = stems.pop((layer, stem))["Z"]
            stems.setdefault((name[:-2], "z"), {})[""] = name
    layers: dict[str, dict[str, tuple[str, ...]]] = {}
    ranks: dict[tuple[str, str], int] = {}
    for (layer, stem), components in stems.items():
        for quantity, rank in _meanings(stem, first, alone=len(names) == 1):
            part = _depth(components) if quantity == "depth" else _triple(components)
            if stem in POSITIONS:
                part = (components["Z"],) if "Z" in components else None
            if part is not None and rank < ranks.get((layer, quantity), 99):
                ranks[layer, quantity] = rank
                layers.setdefault(layer, {})[quantity] = part
    order = ("depth", *QUANTITIES)
    return {layer: {q: found[q] for q in dict.fromkeys(order) if q in found} for layer, found in layers.items()}


def channel_parts(name: str) -> tuple[str, str, str]:
    """Return (layer, stem, component) of a channel: the stem in lower case without spaces and underscores."""
    parts = [part.removeprefix("ray:") for part in name.split(".")]  # Karma's
    component = ""
    glued = _WITHOUT_DOT.match(parts[-1])
    if len(parts) > 1 and len(parts[-1]) == 1 and any(parts[:-1]):
        component = parts.pop().upper()
    elif glued and not (len(parts) > 1 and parts[-1] == parts[-1].lower() and len(parts[-1]) == 1):
        parts[-1], component = glued[1], glued[2].upper()
    stem = re.sub(r"[ _\-]", "", parts[-1].lower())
    for prefix in ("finalimagemovierenderqueue", "movierenderqueue"):
        stem = stem.removeprefix(prefix)
    return ".".join(part for part in parts[:-1] if part), stem, component


def stem_of(name: str) -> str:
    """Return the quantity that a channel's name tells, in lower case without layers, spaces and component."""
    return channel_parts(name)[1]


def _meanings(stem: str, first: Mapping[str, tuple[str, ...]], *, alone: bool) -> Iterable[tuple[str, int]]:
    """Return (quantity, rank) of a stem; the least rank is preferred."""
    for quantity, known in QUANTITIES.items():
        if stem in first.get(quantity, ()):
            yield quantity, first[quantity].index(stem) - len(first[quantity])
        elif stem in known:
            yield quantity, known.index(stem)
    if stem in POSITIONS:
        yield "depth", 50 + POSITIONS.index(stem)
    if alone and stem == "y":
        yield "depth", 90


def _depth(components: Mapping[str, str]) -> tuple[str, ...] | None:
    for component in ("", *_OF_DEPTH):
        if component in components:
            return (components[component],)
    return None


def _triple(components: Mapping[str, str]) -> tuple[str, ...] | None:
    for triple in _TRIPLES:
        if all(component in components for component in triple):
            return tuple(components[component] for component in triple)
    return None


def _listed(layers: Iterable[str]) -> str:
    return ", ".join(repr(name) for name in layers)
