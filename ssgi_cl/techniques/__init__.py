"""Techniques: one module each, and the list by which the command line finds them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ssgi_cl.params import Params
from ssgi_cl.techniques.ssao import SsaoParams, ssao


@dataclass(frozen=True)
class Entry:
    """A technique that turns a G-buffer into an image.

    Attributes:
        function: called with a G-buffer, `runtime` and the parameters.
        params: the dataclass that declares them.
        channel: name of the result in a file.
    """

    function: Callable[..., Any]
    params: type[Params]
    channel: str


TECHNIQUES: dict[str, Entry] = {"ssao": Entry(ssao, SsaoParams, "ao")}
