"""Descriptions and hashes of what determines a truth: two that differ in anything differ in these."""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields
from typing import Any

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Material, Scene

LARGEST_LISTED = 64
"""Numbers of an array that a description still spells out; of a larger one it holds the hash."""


def canonical(value: Any) -> str:
    """Return JSON text that is the same for equal values, whatever the order of their keys."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"))


def digest(*parts: Any) -> str:
    """Return the hash of arrays (their type, shape and bytes) and of what JSON can hold."""
    whole = hashlib.blake2b(digest_size=16)
    for part in parts:
        if isinstance(part, np.ndarray):
            head: Any = ["array", part.dtype.str, part.shape]
            body = np.ascontiguousarray(part).tobytes()
        else:
            head, body = "json", canonical(part).encode()
        # With the lengths in front no two lists of parts have the same bytes.
        whole.update(canonical([head, len(body)]).encode() + body)
    return whole.hexdigest()


def scene_digest(scene: Scene) -> str:
    """Return the hash of all arrays, materials and textures of a scene; of no lights or cameras."""
    if not isinstance(scene, Scene):
        raise TypeError(f"scene is {type(scene).__name__}: expected a Scene (see ssgi_cl.rasterize.load_scene)")
    parts: list[Any] = []
    for field in fields(scene):
        if field.name in ("lights", "cameras", "notes"):
            continue  # those in use are described by themselves
        value = getattr(scene, field.name)
        if field.name == "wraps" and all(wrap == ("repeat", "repeat") for wrap in value):
            continue  # as all textures did before there was a choice
        if field.name == "materials":
            parts += [[_material(material) for material in value]]
        elif field.name == "textures":
            parts += [len(value), *value]
        else:
            parts.append(value)
    return digest(*parts)


def _material(material: Material) -> dict[str, Any]:
    """Return its fields; those of what is seen through it, and of its back, only where they are not the default."""
    values = _values(material)
    if material.double_sided:
        del values["double_sided"]
    if material.emission_texture < 0:
        del values["emission_texture"]
    if not material.is_seen_through:
        del values["blends"], values["transmission"]
    return values


def camera_description(camera: Camera) -> dict[str, Any]:
    """Return matrices and size (rows, columns) of a camera, for a description."""
    if not isinstance(camera, Camera):
        raise TypeError(f"camera is {camera!r}: expected an ssgi_cl.Camera")
    return {**_values(camera), "size": list(camera.size)}


def light_description(light: Light) -> dict[str, Any]:
    """Return kind and values of a light, for a description."""
    return {"kind": type(light).__name__, **_values(light)}


def _values(record: Any) -> dict[str, Any]:
    """Return the fields of a dataclass as JSON can hold them."""
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    for name, value in values.items():
        if isinstance(value, np.ndarray):
            values[name] = value.tolist() if value.size <= LARGEST_LISTED else digest(value)
    return values
