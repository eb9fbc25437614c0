"""The catalogue: the list of all techniques.

`python -m ssgi_cl.techniques.catalogue` prints it as a table in Markdown.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import get_args

from ssgi_cl.core.names import AoTechnique
from ssgi_cl.techniques.ao import bitmask_ao, gtao, hbao, ssao
from ssgi_cl.techniques.area_lights import area_lights
from ssgi_cl.techniques.direct import shade
from ssgi_cl.techniques.filters import bilateral, tonemap, upsample
from ssgi_cl.techniques.multires import multires_splat
from ssgi_cl.techniques.radiosity import radiosity
from ssgi_cl.techniques.reflections import reflections
from ssgi_cl.techniques.rsm import rsm_gather
from ssgi_cl.techniques.sampled_lights import sampled_lights
from ssgi_cl.techniques.sky_rays import sky_rays
from ssgi_cl.techniques.ssdo import ssdo
from ssgi_cl.techniques.technique import Technique
from ssgi_cl.techniques.temporal import accumulate
from ssgi_cl.techniques.vpl import vpl_splat

CATALOGUE: dict[str, Technique] = {
    module.DESCRIPTOR.name: module.DESCRIPTOR
    for module in (
        ssao,
        hbao,
        gtao,
        bitmask_ao,
        ssdo,
        rsm_gather,
        vpl_splat,
        multires_splat,
        radiosity,
        sampled_lights,
        sky_rays,
        area_lights,
        shade,
        reflections,
        tonemap,
        bilateral,
        upsample,
        accumulate,
    )
}
"""All techniques by name."""


def of_kind(kind: str) -> dict[str, Technique]:
    """Return the techniques of a kind by name."""
    return {name: each for name, each in CATALOGUE.items() if each.kind == kind}


TECHNIQUES: dict[str, Technique] = {name: CATALOGUE[name] for name in get_args(AoTechnique)}
"""Techniques of ambient occlusion by name."""


def table(techniques: Iterable[Technique] = CATALOGUE.values()) -> str:
    """Return a table in Markdown: what each technique is, what it reads and what it gives."""
    rows = [("technique", "kind", "paper", "methods", "reads", "gives"), ("---",) * 6]
    for each in techniques:
        rows.append(
            (
                f"`{each.name}`",
                each.kind,
                each.paper,
                ", ".join(each.methods),
                ", ".join(each.reads),
                ", ".join(each.writes),
            )
        )
    return "\n".join(f"| {' | '.join(row)} |" for row in rows) + "\n"


if __name__ == "__main__":
    print(table(), end="")
