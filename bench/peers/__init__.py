"""Other programs at the same work, measured beside this library in the same run.

Each module makes families of cases (see `ssgi_cl.tuning.case.Family`) from one program. None of
them imports that program before it is asked for: `missing()` says in a line what to install.
"""

from __future__ import annotations

from collections.abc import Mapping

from ssgi_cl.tuning.case import Family

from . import embree, mitsuba_frame, mitsuba_rays, pyrender, vtk_ssao

PEERS: Mapping[str, Family] = {
    **embree.FAMILIES,
    **mitsuba_rays.FAMILIES,
    **mitsuba_frame.FAMILIES,
    **vtk_ssao.FAMILIES,
    **pyrender.FAMILIES,
}
"""Families by name."""
