"""What `render` was called with, where several frames make its picture."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.keywords import check_keywords
from ssgi_cl.core.params import parameter_fields
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.renderer import default_ao_radius


class WholeCall(NamedTuple):
    """A call of `render` for the whole picture.

    Attributes:
        arguments: by name, of a call for a part of it but for the camera; what the whole picture decides is set.
        camera: of the whole picture.
        params: of its frame.
        runtime: the device.
    """

    arguments: dict[str, Any]
    camera: Camera
    params: FrameParams
    runtime: Runtime

    @classmethod
    def of(
        cls, render: Callable[..., Any], args: tuple[Any, ...], kwargs: Mapping[str, Any], *without: str
    ) -> WholeCall:
        """Return the call; the arguments `without` are not for its parts.

        Raises:
            TypeError: an argument of an unknown name, or the camera is none.
        """
        check_keywords(render, kwargs)
        arguments = dict(inspect.signature(render).bind(*args, **kwargs).arguments)
        for name in without:
            arguments.pop(name, None)
        camera = arguments["camera"]
        if not isinstance(camera, Camera):
            raise TypeError(f"camera is {camera!r}: expected an ssgi_cl.Camera")
        params = FrameParams(**{name: arguments[name] for name in arguments if name in parameter_fields(FrameParams)})
        runtime = arguments["runtime"] = arguments.get("runtime") or Runtime.open()
        if params.kind != "whole" and params.needs_radius:
            arguments["ao_radius"] = default_ao_radius(arguments["scene"], camera, runtime)
        return cls(arguments, camera, params, runtime)
