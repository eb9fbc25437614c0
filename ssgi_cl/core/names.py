"""Names that arguments are chosen from, as types; what is checked at run time is made of them with `get_args`."""

from __future__ import annotations

from typing import Literal

Preset = Literal["low", "medium", "high", "ultra"]
"""From the fastest to the best."""
AoTechnique = Literal["ssao", "hbao", "gtao", "bitmask_ao"]
"""Techniques of ambient occlusion."""
OneBounce = Literal["multires", "vpl", "gather", "ssdo"]
"""Techniques of one bounce of light in frames; the first is the default."""
All = Literal["all"]
"""As many bounces as it takes."""
Bounces = int | All

SsdoMethod = Literal["bitmask", "points", "published"]
MultiresMethod = Literal["adaptive", "published"]
GatherMethod = Literal["unbiased", "published"]
BounceMethod = SsdoMethod | MultiresMethod | GatherMethod
"""Methods of techniques of one bounce."""

Resolution = Literal["full", "half", "quarter"]
"""Size at which occlusion is computed."""
BlurResolution = Literal["own", "full"]
GatherResolution = Literal["full", "adaptive"]
Curve = Literal["clip", "filmic"]
"""Tone curves, in the order of their numbers in kernels."""
