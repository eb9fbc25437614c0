"""What can be measured, by family: this library's techniques, and its peers."""

from __future__ import annotations

from collections.abc import Mapping

from ..case import Family
from ..peers import PEERS
from . import bilateral, rasterize, shade, slices, ssao, upsample

OWN: Mapping[str, Family] = {
    **ssao.FAMILIES,
    **slices.FAMILIES,
    **bilateral.FAMILIES,
    **upsample.FAMILIES,
    **shade.FAMILIES,
    **rasterize.FAMILIES,
}
"""This library's."""

FAMILIES: Mapping[str, Family] = {**OWN, **PEERS}
"""All of them."""
