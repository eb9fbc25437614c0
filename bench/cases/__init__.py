"""What can be measured, by family: this library's techniques, and its peers."""

from __future__ import annotations

from collections.abc import Mapping

from ssgi_cl.tuning.case import Family

from ..peers import PEERS
from . import (
    bent_normals,
    bilateral,
    converged,
    floor,
    lecture,
    multires_published,
    multires_splat,
    rasterize,
    rsm_gather,
    rsm_published,
    shade,
    skips,
    slices,
    ssao,
    ssdo,
    upsample,
    vpl_lobes,
    vpl_splat,
)

OWN: Mapping[str, Family] = {
    **ssao.FAMILIES,
    **slices.FAMILIES,
    **converged.FAMILIES,
    **bent_normals.FAMILIES,
    **lecture.FAMILIES,
    **floor.FAMILIES,
    **bilateral.FAMILIES,
    **upsample.FAMILIES,
    **shade.FAMILIES,
    **rsm_gather.FAMILIES,
    **rsm_published.FAMILIES,
    **ssdo.FAMILIES,
    **rasterize.FAMILIES,
    **skips.FAMILIES,
    **vpl_splat.FAMILIES,
    **vpl_lobes.FAMILIES,
    **multires_splat.FAMILIES,
    **multires_published.FAMILIES,
}
"""This library's."""

FAMILIES: Mapping[str, Family] = {**OWN, **PEERS}
"""All of them."""
