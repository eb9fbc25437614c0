"""A glTF file's JSON and bytes: read, checked, cut into views."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ssgi_cl.core.errors import SceneError, shown
from ssgi_cl.rasterize.files.gltf_schema import DRACO, KTX2, LIGHTS, VISIBILITY, Json, check_document
from ssgi_cl.rasterize.files.textures import UTF8_MARK, read_uri

UNDERSTOOD = (DRACO, "KHR_mesh_quantization", "KHR_texture_transform", LIGHTS, VISIBILITY, KTX2, "EXT_texture_webp")
"""Besides KHR_materials_*, whose base colour and emission are usable whatever else they add."""
_REFUSED = ("EXT_meshopt_compression", "KHR_meshopt_compression", "EXT_mesh_gpu_instancing")


def read_document(path: Path) -> tuple[Json, list[memoryview]]:
    """Return the JSON of a .glb or .gltf file, checked, and the bytes of its buffer views.

    Raises:
        SceneError: it is damaged, not glTF 2.0, or needs an extension that is not supported.
    """
    document, binary = _parsed(path)
    check_document(document)
    version = document["asset"]["version"]
    if not version.startswith("2"):
        raise SceneError(f"{path} is glTF {version[:20]!r}: expected 2.0")
    _check_extensions(document)
    return document, _views(document, _buffers(document, binary, path.parent))


def item(items: Sequence[Any], index: int, what: str) -> Any:
    """Return items[index]; `what` names the index in the message if it is out of range."""
    if not 0 <= index < len(items):
        raise SceneError(f"{what} is {index}: expected less than {len(items)}, the number of them")
    return items[index]


def _parsed(path: Path) -> tuple[Any, bytes | None]:
    """Return the JSON document and, for .glb, the binary chunk."""
    data = path.read_bytes()
    binary = None
    if data[:4] == b"glTF":
        if len(data) < 20:
            raise SceneError(f"{path} ends within the header of a .glb file")
        version, length, json_length, kind = struct.unpack_from("<4I", data, 4)
        if version != 2 or kind != 0x4E4F534A:
            raise SceneError(f"{path} is not glTF 2.0 (version {version})")
        if length > len(data) or 20 + json_length > len(data):
            raise SceneError(f"{path} is cut off: {len(data)} bytes of {length}")
        text = data[20 : 20 + json_length]
        start = 20 + json_length
        while binary is None and start + 8 <= len(data):
            size, kind = struct.unpack_from("<2I", data, start)
            if start + 8 + size > len(data):
                raise SceneError(f"{path} is cut off within its binary chunk")
            if kind == 0x004E4942:
                binary = data[start + 8 : start + 8 + size]
            start += 8 + size
    else:
        text = data
    try:
        return json.loads(text.removeprefix(UTF8_MARK)), binary
    except (ValueError, RecursionError) as error:
        raise SceneError(f"{path} is not glTF: {error}") from None


def _check_extensions(document: Json) -> None:
    used = {*document.get("extensionsUsed", []), *document.get("extensionsRequired", [])}
    for holder in (*document.get("bufferViews", []), *document.get("nodes", [])):
        used |= set(holder.get("extensions", {}))
    for name in _REFUSED:
        if name in used:
            raise SceneError(f"the file uses {name}, which is not supported: export it without")
    for name in document.get("extensionsRequired", []):
        if name not in UNDERSTOOD and not name.startswith("KHR_materials_"):
            raise SceneError(f"the file requires {shown(name)}, which is not supported")


def _buffers(document: Json, binary: bytes | None, folder: Path) -> list[bytes]:
    buffers = []
    for index, buffer in enumerate(document.get("buffers", [])):
        uri = buffer.get("uri")
        if uri is None:
            data = binary if index == 0 else None
            if data is None:
                raise SceneError(f"buffer {index} has neither a uri nor a binary chunk")
        else:
            data = read_uri(uri, folder, f"the uri of buffer {index}")
        if len(data) < buffer["byteLength"]:
            raise SceneError(f"buffer {index} has {len(data)} bytes: expected {buffer['byteLength']}")
        buffers.append(data)
    return buffers


def _views(document: Json, buffers: list[bytes]) -> list[memoryview]:
    views = []
    for index, view in enumerate(document.get("bufferViews", [])):
        start, length = view.get("byteOffset", 0), view["byteLength"]
        buffer = item(buffers, view["buffer"], f"the buffer of view {index}")
        if start + length > len(buffer):
            raise SceneError(f"buffer view {index} covers bytes {start} to {start + length} of {len(buffer)}")
        # Not copied: many views may cover the same bytes.
        views.append(memoryview(buffer)[start : start + length])
    return views
