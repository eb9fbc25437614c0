"""Source of the surfaces of pixels: a G-buffer, or a reduced one, and what kernels read of it."""

from __future__ import annotations

from typing import Any, Protocol

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer


class Source(Protocol):
    """A G-buffer in device memory, or every so-many-th pixel of one.

    Attributes:
        size: (rows, columns) of the image.
        margin: (rows, columns) by which planes exceed it on every side, at least.
        whole: (rows, columns) of the planes.
        depth: scene units, +inf where nothing is.
        linear: 1 / depth of a perspective camera, else -depth; see kernels/common/gbuffer.clh.
        normal: in view space, 0 where nothing is.
        camera_struct: the kernels' camera of these pixels.
    """

    @property
    def size(self) -> Size: ...
    @property
    def margin(self) -> Size: ...
    @property
    def whole(self) -> Size: ...
    @property
    def depth(self) -> Plane: ...
    @property
    def linear(self) -> Plane: ...
    @property
    def normal(self) -> Plane: ...
    @property
    def camera_struct(self) -> Any: ...


def camera_of(gbuffer: DeviceGBuffer) -> Camera:
    """Return the camera of what a G-buffer holds; raise ValueError if that is nothing."""
    if gbuffer.camera is None:
        raise ValueError("the device G-buffer is empty: draw or upload something first")
    return gbuffer.camera


def check_size(gbuffer: DeviceGBuffer, size: Size, margin: Size) -> None:
    """Raise ValueError if a G-buffer is not of the size and margin that a technique expects."""
    if (gbuffer.size, gbuffer.margin) != (size, margin):
        raise ValueError(
            f"the G-buffer's size and margin are {gbuffer.size} and {gbuffer.margin}: expected {size} and {margin}"
        )


def margin_values(margin: Size) -> dict[str, int]:
    """Return a margin as members of a struct: pixels before the first column and row."""
    return {"margin_columns": margin[1], "margin_rows": margin[0]}


def border_values(source: Source, size: Size) -> dict[str, int]:
    """Return how far `source` exceeds a result of `size` on each side, as members of a struct."""
    return {
        "margin_left": source.margin[1],
        "margin_right": source.whole[1] - size[1] - source.margin[1],
        "margin_top": source.margin[0],
        "margin_bottom": source.whole[0] - size[0] - source.margin[0],
    }
