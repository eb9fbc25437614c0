"""What passes read the surfaces of pixels from: a G-buffer, or a reduced one."""

from __future__ import annotations

from typing import Any, Protocol

from ssgi_cl.device.arrays import Plane, Size


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
