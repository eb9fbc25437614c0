"""Cameras of a glTF file as its animations move them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.errors import SceneError, shown
from ssgi_cl.core.scene_camera import SceneCamera
from ssgi_cl.rasterize.files.gltf_accessors import Accessors
from ssgi_cl.rasterize.files.gltf_document import item, read_document
from ssgi_cl.rasterize.files.gltf_nodes import placed_nodes
from ssgi_cl.rasterize.files.gltf_schema import Json
from ssgi_cl.rasterize.files.gltf_view import placed_camera

Doubles = NDArray[np.float64]

MOST_FRAMES = 100_000
"""Of an animation, at its frames a second."""
_KINDS = {"translation": "VEC3", "rotation": "VEC4", "scale": "VEC3"}
"""What of a node moves it, and its type."""
_INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")


def is_gltf(path: Path) -> bool:
    """Return whether a file is glTF by its name."""
    return path.suffix.lower() in (".glb", ".gltf")


class _Track(NamedTuple):
    """How one property of a node goes on.

    Attributes:
        times: [keys] seconds, increasing.
        values: [keys, numbers]; with `tangents` those between.
        tangents: [keys, 2, numbers] into and out of each key, a second, or None.
        steps: whether each value holds until the next.
        turns: whether it is a rotation, a quaternion of unit length.
    """

    times: Doubles
    values: Doubles
    tangents: Doubles | None
    steps: bool
    turns: bool

    def at(self, time: float) -> list[float]:
        """Return the value at a time, held before the first key and after the last (glTF 2.0, appendix C)."""
        after = int(np.searchsorted(self.times, time, side="right"))
        if after == 0 or after == len(self.times):
            found = self.values[min(after, len(self.times) - 1)]
        else:
            first, last = self.values[after - 1], self.values[after]
            span = float(self.times[after] - self.times[after - 1])
            share = (time - float(self.times[after - 1])) / span
            if self.steps:
                found = first
            elif self.tangents is not None:
                leave, enter = span * self.tangents[after - 1, 1], span * self.tangents[after, 0]
                s2, s3 = share**2, share**3
                found = (2 * s3 - 3 * s2 + 1) * first + (s3 - 2 * s2 + share) * leave
                found = found + (3 * s2 - 2 * s3) * last + (s3 - s2) * enter
            elif self.turns:
                found = _turned(first, last, share)
            else:
                found = first + share * (last - first)
        if self.turns:
            found = found / max(float(np.linalg.norm(found)), 1e-30)
        result: list[float] = found.tolist()
        return result


def _turned(first: Doubles, last: Doubles, share: float) -> Doubles:
    """Return the rotation between two, along the shorter way."""
    cosine = float(first @ last)
    if cosine < 0.0:
        last, cosine = -last, -cosine
    if cosine > 0.9995:  # the sines of the ends would cancel
        return first + share * (last - first)
    angle = math.acos(cosine)
    found: Doubles = (math.sin((1 - share) * angle) * first + math.sin(share * angle) * last) / math.sin(angle)
    return found


def animated_cameras(path: Path, fps: float, name: str | None = None) -> list[SceneCamera]:
    """Return a camera of a glTF file at each frame of the file's animations, from their first key to their last.

    All animations of the file play at once. Where nothing is said of a node, it stands as the file places it.

    Args:
        path: a .glb or .gltf file.
        fps: frames a second, > 0.
        name: of the camera's node, or of the camera; None: the first one that moves.

    Raises:
        ValueError: `fps` is out of range.
        SceneError: the file is damaged, or no such camera moves in it; the message says which do.
    """
    fps = checks.number("fps", fps, low=0.0, high=1e4, above=True, unit="frames a second")
    document, views = read_document(path)
    tracks = dict(_tracks(document, Accessors(document, views)))
    nodes = document.get("nodes", [])
    parents = {child: index for index, node in enumerate(nodes) for child in node.get("children", [])}
    placed = sorted(index for index, _ in placed_nodes(document))
    moving = {
        index: own for index in placed if "camera" in nodes[index] and (own := _own(tracks, _chain(index, parents)))
    }
    names = {index: _name(document, index) for index in moving}
    chosen = [index for index in moving if name is None or names[index] == name]
    if not chosen:
        known = ", ".join(map(shown, names.values())) or "none"
        which = "no camera" if name is None else f"no camera {shown(name)}"
        raise SceneError(f"{path} moves {which}: expected one that an animation moves (it has {known})")
    index = chosen[0]
    return _played(document, index, moving[index], names[index], fps)


def _chain(index: int, parents: Mapping[int, int]) -> Iterable[int]:
    """Give a node and all above it."""
    while True:
        yield index
        if index not in parents:
            return
        index = parents[index]


def _own(tracks: Mapping[tuple[int, str], _Track], chain: Iterable[int]) -> dict[tuple[int, str], _Track]:
    """Return the tracks of some nodes."""
    members = set(chain)
    return {key: track for key, track in tracks.items() if key[0] in members}


def _name(document: Json, index: int) -> str:
    node = document["nodes"][index]
    source: Json = item(document.get("cameras", []), node["camera"], f"the camera of node {index}")
    return str(node.get("name") or source.get("name") or f"camera {index}")


def _played(
    document: Json, index: int, tracks: Mapping[tuple[int, str], _Track], name: str, fps: float
) -> list[SceneCamera]:
    """Return the camera of a node at each frame."""
    begin = min(float(track.times[0]) for track in tracks.values())
    end = max(float(track.times[-1]) for track in tracks.values())
    count = math.floor((end - begin) * fps + 1e-6) + 1
    if count > MOST_FRAMES:
        raise SceneError(
            f"the animation of {shown(name)} lasts {end - begin:g} s: expected at most {MOST_FRAMES} frames at {fps:g} "
            "frames a second"
        )
    source = document["cameras"][document["nodes"][index]["camera"]]
    cameras = []
    for number in range(count):
        nodes = list(document["nodes"])
        for (node, what), track in tracks.items():
            nodes[node] = {**nodes[node], what: track.at(begin + number / fps)}
        matrix = dict(placed_nodes({**document, "nodes": nodes}))[index]
        wrong: list[str] = []
        found = placed_camera(source, matrix, name, wrong)
        if wrong:
            raise SceneError(f"frame {number + 1}: {wrong[0]}")
        cameras.append(found[name])
    return cameras


def _tracks(document: Json, accessors: Accessors) -> Iterable[tuple[tuple[int, str], _Track]]:
    """Give (node, property) and track of all that moves nodes."""
    for number, animation in enumerate(document.get("animations", [])):
        samplers, channels = _list(animation, "samplers", number), _list(animation, "channels", number)
        for channel in channels:
            where = f"a channel of animation {number}"
            target = channel.get("target")
            if not isinstance(target, dict):
                raise SceneError(f"{where} has no target")
            node, what = target.get("node"), target.get("path")
            if node is None or what not in _KINDS:
                continue  # morph targets, and what extensions move
            at = f"the node of {where}"
            if "matrix" in item(document.get("nodes", []), _whole(node, at), at):
                raise SceneError(
                    f"{where} moves node {node}, which has a matrix: expected translation, rotation, scale"
                )
            sampler = item(
                samplers, _whole(channel.get("sampler"), f"the sampler of {where}"), f"the sampler of {where}"
            )
            yield (node, what), _track(sampler, what, accessors, f"the sampler of {where}")


def _list(animation: Json, key: str, number: int) -> list[Json]:
    found: Any = animation.get(key)
    if not isinstance(found, list) or not all(isinstance(each, dict) for each in found):
        raise SceneError(f"animation {number} has no list of {key}")
    return found


def _whole(value: object, what: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise SceneError(f"{what} is {shown(str(value))}: expected a number of one")
    return value


def _track(sampler: Json, what: str, accessors: Accessors, where: str) -> _Track:
    interpolation = sampler.get("interpolation", "LINEAR")
    if interpolation not in _INTERPOLATIONS:
        raise SceneError(f"{where} is {shown(str(interpolation))}: expected {', '.join(_INTERPOLATIONS)}")
    times = accessors.floats(_whole(sampler.get("input"), f"the input of {where}"), ("SCALAR",)).reshape(-1)
    values = accessors.floats(_whole(sampler.get("output"), f"the output of {where}"), (_KINDS[what],))
    if not len(times) or not np.isfinite(times).all() or times[0] < 0.0 or (np.diff(times) <= 0.0).any():
        raise SceneError(f"the times of {where} do not increase from 0 s on")
    each = 3 if interpolation == "CUBICSPLINE" else 1
    values = values.reshape(len(values), -1)
    if len(values) != each * len(times) or not np.isfinite(values).all():
        raise SceneError(f"{where} has {len(values)} values: expected {each * len(times)}, all finite")
    tangents = None
    if each == 3:
        keys = values.reshape(len(times), 3, -1)
        tangents, values = keys[:, [0, 2]], keys[:, 1]
    return _Track(times, values, tangents, interpolation == "STEP", what == "rotation")
