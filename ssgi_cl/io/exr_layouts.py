"""Layouts of OpenEXR files by program: which channels hold depth and normals, and what kind of depth that is.

A layout prefers its own names; others are found as well. What planes of the depth and normals themselves say
(`core.depth_kind`, `core.normal_space`) goes before what a layout expects, since versions and options of a
program differ.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ssgi_cl.core import checks


@dataclass(frozen=True, kw_only=True)
class Layout:
    """Conventions of one program.

    Attributes:
        name: of the program.
        depths: kinds of depth by the name of the quantity (lower case, without spaces), the first preferred; kinds
            are those of `core.depth_kind.KINDS`, or "" for one that has to be said.
        normals: names of normals, the first preferred.
        attributes: expression for names of attributes that the program writes, or for its name in "software".
        channels: expression for names of channels that no other program has.
    """

    name: str
    depths: Mapping[str, str] = field(default_factory=dict)
    normals: tuple[str, ...] = ()
    attributes: str = ""
    channels: str = ""


LAYOUTS = {
    each.name: each
    for each in (
        Layout(
            name="blender",
            depths={"depth": "planar", "z": "planar", "denoisingdepth": "planar"},
            normals=("normal", "denoisingnormal"),
            attributes=r"blender.*|cycles\..*",
            channels=r"(.*\.)?(DiffCol|Diffuse Color|Denoising (Depth|Normal|Albedo)|IndexOB|CryptoObject00)\..*",
        ),
        Layout(
            name="arnold",
            depths={"z": "planar"},
            normals=("n",),
            attributes=r"arnold(/.*)?|camerafilmaperture.*",
            channels=r"(.*\.)?(diffuse_albedo|shadow_matte|motionvector)\..*",
        ),
        Layout(
            name="v-ray",
            depths={"zdepth": "remapped", "z": "remapped", "vrayzdepth": "remapped"},
            normals=("normals", "vraynormals", "n"),
            attributes=r"v-?ray.*|cameraaperture|cameratransform",
            channels=r"(VRay.*|diffuseFilter\..*|rawGlobalIllumination\..*|ZDepth(\..*)?)",
        ),
        Layout(
            name="redshift",
            depths={"z": "planar", "depth": "planar"},
            normals=("n", "normals"),
            attributes=r"(rs|redshift)/.*",
        ),
        Layout(
            name="karma",
            depths={"hitp": "planar", "p": "planar", "depth": "planar", "hitdist": "ray"},
            normals=("hitn", "n"),
            attributes=r"karma.*|husk.*|houdini.*",
            channels=r"(ray:)?hit(Pz|dist|N[xyz.].*|N\..*)",
        ),
        Layout(
            name="renderman",
            depths={"depth": "planar", "z": "planar"},
            normals=("nworld", "nn", "n"),
            attributes=r"(prman|renderman).*|nl|np",
            channels=r"__(depth|Nworld|Pworld).*",
        ),
        Layout(
            name="unreal",
            depths={"worlddepth": "planar", "scenedepth": "planar"},
            normals=("worldnormal",),
            attributes=r"unreal/.*",
            channels=r"(FinalImage)?MovieRenderQueue_.*",
        ),
        Layout(
            name="nuke", depths={"depth": "inverse", "z": "inverse"}, normals=("n", "normals"), attributes=r"nuke/.*"
        ),
        Layout(
            name="hydra", depths={"depth": "", "z": "planar"}, normals=("n", "normal", "neye"), attributes=r"hydra.*"
        ),
    )
}
"""By name."""


def layout_of(name: str | None, channels: Iterable[str], attributes: Mapping[str, object]) -> tuple[Layout | None, str]:
    """Return the layout that was asked for, or the one that a file shows, and a note; None if it shows none.

    Raises:
        ValueError: there is no layout of this name; the message names the nearest.
    """
    if name is not None:
        return LAYOUTS[checks.choice("layout", name, tuple(LAYOUTS))], f"layout: {name}, as said"
    software = " ".join(str(value) for key, value in attributes.items() if key.lower() in ("software", "creator"))
    names = [*attributes, *re.findall(r"[A-Za-z][\w\-]*", software)]
    own = tuple(channels)
    for layout in LAYOUTS.values():
        marks = [n for n in names if layout.attributes and re.fullmatch(layout.attributes, n, re.IGNORECASE)]
        marks += [n for n in own if layout.channels and re.fullmatch(layout.channels, n)]
        if marks:
            return layout, f"layout: {layout.name}, by {marks[0]!r}"
    return None, ""
