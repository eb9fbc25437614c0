"""The struct of values that kernels of virtual point lights and of the occupancy grid share."""

from __future__ import annotations

from ssgi_cl.device.structs import Struct, floats

VPL = Struct(
    "VplParams",
    (
        *floats("per_unit", "gain", "cutoff", "lobe_centre", "lobe_squared", "lift", "refine"),
        *((n, "int") for n in ("segment", "count", "stride", "span", "capacity", "near_capacity")),
        *((n, "int") for n in ("margin_columns", "margin_rows")),
    ),
)
