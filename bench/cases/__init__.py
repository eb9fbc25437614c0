"""Families of cases that can be measured: this library's techniques, and its peers."""

from __future__ import annotations

from collections.abc import Mapping

from ssgi_cl.tuning.case import Family

from ..peers import PEERS
from . import ao, drawing, filters, frame, multires_splat, radiosity, rsm_gather, slices, ssdo, vpl_splat

OWN: Mapping[str, Family] = {
    name: family
    for module in (ao, slices, filters, frame, rsm_gather, ssdo, drawing, vpl_splat, multires_splat, radiosity)
    for name, family in module.FAMILIES.items()
}
"""This library's."""

FAMILIES: Mapping[str, Family] = {**OWN, **PEERS}
"""All of them."""
