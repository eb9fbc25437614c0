"""Motion among the channels of an OpenEXR file, by the names that programs give it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ssgi_cl.io.exr_channels import channel_parts

NAMES: dict[str, tuple[str, ...]] = {
    "pixels": ("motion",),
    "blender": ("vector",),
    "nuke": ("forward", "motionfore"),
    "ndc": ("motionvector", "motionvectors", "velocity", "motion"),
}
"""Names of each convention of `core.motion.MOTION_KINDS`, lower case, without spaces; the first preferred."""

_COMPONENTS = (("X", "Y", "Z"), ("U", "V", ""), ("R", "G", "B"))
"""Components of motion across and down, and of the change of depth, which "pixels" alone has."""


def motion_channels(
    names: Iterable[str], kind: str | None, layer: str | None = None, given: str | Sequence[str] | None = None
) -> tuple[str, ...]:
    """Return the channels of motion, two or three, among the names of a file.

    Args:
        names: of all channels.
        kind: convention whose names are looked for; None looks for all.
        layer: whose channels count; None for all.
        given: the channels, or the stem of them ("Vector" for Vector.X and Vector.Y), that are known already.

    Raises:
        ValueError: there are none.
    """
    present = tuple(names)
    if given is not None and not isinstance(given, str):
        missing = [name for name in given if name not in present]
        if missing or len(given) not in (2, 3):
            raise ValueError(
                f"channels['motion'] is {tuple(given)!r}: expected two or three of {', '.join(sorted(present))}"
            )
        return tuple(given)
    stems: dict[str, dict[str, str]] = {}
    for name in present:
        own, stem, component = channel_parts(name)
        if layer is None or own == layer or given is not None:
            stems.setdefault(stem if given is None else name.rpartition(".")[0], {})[component] = name
    kinds = NAMES if kind is None else {kind: NAMES[kind]}
    wanted = [given] if given is not None else [stem for own in kinds.values() for stem in own]
    for stem in wanted:
        found = stems.get(stem, {})
        for across, down, deep in _COMPONENTS:
            if across in found and down in found:
                third = (found[deep],) if deep in found and stem == "motion" and kind in (None, "pixels") else ()
                return (found[across], found[down], *third)
    raise ValueError(
        f"no channels of motion ({', '.join(dict.fromkeys(map(str, wanted)))} with .X and .Y, .u and .v, or .R and "
        f".G): expected channels={{'motion': (...)}} out of {', '.join(sorted(present))}"
    )
