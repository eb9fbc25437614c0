"""Schema of a glTF document's JSON as far as it is read: types, counts, numbers.

Every value that is used later is checked here once, so that a fault is named with its place and no
other module meets a value of the wrong type.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ssgi_cl.core.errors import SceneError, shown

Json = dict[str, Any]

DRACO = "KHR_draco_mesh_compression"
LIGHTS = "KHR_lights_punctual"
VISIBILITY = "KHR_node_visibility"
KTX2 = "KHR_texture_basisu"

_Rule = Callable[[Any, str], None]
_Schema = Any
"""A rule; a dict of property -> schema ("!" behind what must be there); a list of one schema."""

_LARGEST = 1e300
"""Numbers beyond are damage, and would become infinite as soon as they are used."""


def check_document(document: Any) -> None:
    """Raise SceneError where `document` is not what glTF 2.0 says, as far as it is read."""
    _check(document, _DOCUMENT, "the document")


def _wrong(value: Any, where: str, expected: str) -> SceneError:
    return SceneError(f"{where} is {shown(value)}: expected {expected}")


def _check(value: Any, schema: _Schema, where: str) -> None:
    if isinstance(schema, dict):
        _object(value, where)
        for key, inner in schema.items():
            name = key.removesuffix("!")
            if name in value:
                _check(value[name], inner, name if where == "the document" else f"{where}.{name}")
            elif name != key:
                raise SceneError(f"{where} has no {name!r}")
    elif isinstance(schema, list):
        if not isinstance(value, list):
            raise _wrong(value, where, "a list")
        for index, item in enumerate(value):
            _check(item, schema[0], f"{where}[{index}]")
    else:
        schema(value, where)


def _object(value: Any, where: str) -> None:
    if not isinstance(value, dict):
        raise _wrong(value, where, "an object")


def _every(schema: _Schema) -> _Rule:
    """Return the rule of an object whose properties, whatever their names, all fit `schema`."""

    def rule(value: Any, where: str) -> None:
        _object(value, where)
        for name, item in value.items():
            _check(item, schema, f"{where}.{shown(name)}")

    return rule


def _integer(value: Any, where: str) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise _wrong(value, where, "an integer, 0 or more")


def _number(value: Any, where: str) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise _wrong(value, where, "a number")
    if not -_LARGEST < value < _LARGEST:
        raise SceneError(f"{where} is {shown(value)}, which is not finite: expected a number")


def _numbers(count: int) -> _Rule:
    def rule(value: Any, where: str) -> None:
        if not isinstance(value, list) or len(value) != count:
            raise _wrong(value, where, f"{count} numbers")
        for index, item in enumerate(value):
            _number(item, f"{where}[{index}]")

    return rule


def _text(value: Any, where: str) -> None:
    if not isinstance(value, str):
        raise _wrong(value, where, "a text")


def _truth(value: Any, where: str) -> None:
    if not isinstance(value, bool):
        raise _wrong(value, where, "true or false")


_TEXTURE_INFO = {
    "index!": _integer,
    "texCoord": _integer,
    "extensions": {
        "KHR_texture_transform": {
            "offset": _numbers(2),
            "scale": _numbers(2),
            "rotation": _number,
            "texCoord": _integer,
        }
    },
}

_MATERIAL = {
    "name": _text,
    "alphaMode": _text,
    "alphaCutoff": _number,
    "emissiveFactor": _numbers(3),
    "emissiveTexture": _TEXTURE_INFO,
    "pbrMetallicRoughness": {
        "baseColorFactor": _numbers(4),
        "baseColorTexture": _TEXTURE_INFO,
        "metallicFactor": _number,
        "roughnessFactor": _number,
    },
    "extensions": {
        "KHR_materials_emissive_strength": {"emissiveStrength": _number},
        "KHR_materials_transmission": {"transmissionFactor": _number, "transmissionTexture": _TEXTURE_INFO},
        "KHR_materials_pbrSpecularGlossiness": {
            "diffuseFactor": _numbers(4),
            "diffuseTexture": _TEXTURE_INFO,
            "specularFactor": _numbers(3),
            "glossinessFactor": _number,
        },
    },
}

_PRIMITIVE = {
    "attributes!": _every(_integer),
    "indices": _integer,
    "material": _integer,
    "mode": _integer,
    "extensions": {DRACO: {"bufferView!": _integer, "attributes!": _every(_integer)}},
}

_LIGHT = {
    "type!": _text,
    "name": _text,
    "color": _numbers(3),
    "intensity": _number,
    "range": _number,
    "spot": {"innerConeAngle": _number, "outerConeAngle": _number},
}

_CAMERA = {
    "type!": _text,
    "name": _text,
    "perspective": {"yfov!": _number, "znear!": _number, "zfar": _number, "aspectRatio": _number},
    "orthographic": {"xmag!": _number, "ymag!": _number, "znear!": _number, "zfar!": _number},
}


def _node_extensions(value: Any, where: str) -> None:
    """Check the extensions of a node, those that are read to their values."""
    _check(value, _every(_object), where)
    _check(value, {LIGHTS: {"light!": _integer}, VISIBILITY: {"visible": _truth}}, where)


_DOCUMENT = {
    "asset!": {"version!": _text},
    "extensionsUsed": [_text],
    "extensionsRequired": [_text],
    "extensions": {LIGHTS: {"lights": [_LIGHT]}},
    "cameras": [_CAMERA],
    "animations": [_object],
    "scene": _integer,
    "scenes": [{"nodes": [_integer]}],
    "nodes": [
        {
            "name": _text,
            "mesh": _integer,
            "camera": _integer,
            "children": [_integer],
            "matrix": _numbers(16),
            "translation": _numbers(3),
            "rotation": _numbers(4),
            "scale": _numbers(3),
            "skin": _integer,
            "extensions": _node_extensions,
        }
    ],
    "meshes": [{"primitives!": [_PRIMITIVE]}],
    "materials": [_MATERIAL],
    "textures": [
        {"source": _integer, "extensions": {"EXT_texture_webp": {"source": _integer}, KTX2: {"source": _integer}}}
    ],
    "images": [{"uri": _text, "bufferView": _integer, "name": _text}],
    "accessors": [
        {
            "type!": _text,
            "componentType!": _integer,
            "count!": _integer,
            "byteOffset": _integer,
            "bufferView": _integer,
            "normalized": _truth,
            "sparse": {
                "count!": _integer,
                "indices!": {"bufferView!": _integer, "byteOffset": _integer, "componentType!": _integer},
                "values!": {"bufferView!": _integer, "byteOffset": _integer},
            },
        }
    ],
    "skins": [{"joints!": [_integer], "inverseBindMatrices": _integer}],
    "bufferViews": [
        {
            "buffer!": _integer,
            "byteLength!": _integer,
            "byteOffset": _integer,
            "byteStride": _integer,
            "extensions": _every(_object),
        }
    ],
    "buffers": [{"byteLength!": _integer, "uri": _text}],
}
