"""G-buffers of OpenEXR files: planar depth and normals in world space of what a file stores."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.depth_kind import planar_of
from ssgi_cl.core.depth_maps import world_normals
from ssgi_cl.core.formats import files
from ssgi_cl.core.normal_space import SAME, UnclearSpaceError


def exr_arrays(
    path: str | os.PathLike[str],
    camera: Camera | None,
    channels: Mapping[str, str | tuple[str, ...]] | None,
    *,
    layer: str | None,
    part: str | None,
    layout: str | None,
    normal_space: str | None,
    depth_kind: str | None,
    depth_range: tuple[float, float] | None,
) -> dict[str, Any]:
    """Return the arguments of `GBuffer` that a file holds; all as of `GBuffer.from_exr`."""
    name, said, axes = os.fspath(path), "", SAME
    if camera is None:
        camera, said, axes = files().read_camera(path)
        if camera is None:
            raise ValueError(
                f"{name}: camera is None, and the header has none ({said or 'no attribute of one'}): expected "
                "camera=, such as Camera.look_at((0, 0, 0), (0, 0, -1), yfov=..., width=..., height=...)"
            )
    arrays, expected = files().read_with_kind(path, channels, size=camera.size, layer=layer, part=part, layout=layout)
    try:
        arrays["depth"], kind = planar_of(
            arrays["depth"], camera, depth_kind, expected=expected, depth_range=depth_range
        )
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    arrays["notes"] = (*filter(None, [said]), *arrays["notes"], kind)
    if "normal" in arrays:
        try:
            found = world_normals(arrays["normal"], arrays["depth"], camera, normal_space, known=True, axes=axes)
            arrays |= {"normal": found[0], "notes": (*arrays["notes"], found[1])}
        except UnclearSpaceError as error:
            if not error.few:
                raise type(error)(f"{name}: {error}") from None
    return {**arrays, "camera": camera}
