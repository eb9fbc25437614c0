"""Pass: light as its mean over the frames in which each surface was seen."""

from __future__ import annotations

from typing import Any

from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.passes.resources import DIRECT, GBUFFER, HISTORY, LIGHTS, PUNCTUAL, SCENE
from ssgi_cl.frame.stage import Declared, Stage


def history(build: Build) -> list[Stage]:
    """Return the pass; none of a frame without a history."""
    names = build.averaged
    if not names:
        return []

    punctual = (PUNCTUAL,) if build.params.kind == "whole" else ()

    def run(r: Declared) -> Any:
        planes = {name: r[name] for name in names if r[name] is not None}
        if planes:
            # Light through shadow maps has no noise: its means are for smooth edges alone.
            exact = any(r[name] is planes.get(DIRECT) for name in punctual)
            apart = {DIRECT: exact} if punctual else {}
            planes = r[HISTORY].add(planes, r[GBUFFER], r[SCENE], r[LIGHTS], apart=apart)
        else:
            build.runtime.skip("accumulate", "nothing differs from frame to frame")
        found = tuple(planes.get(name) for name in names)
        return found if len(found) > 1 else found[0]

    return [
        Stage(
            name="history",
            reads=(GBUFFER, SCENE, LIGHTS, HISTORY, *punctual, *names),
            writes=tuple(map(build.steady, names)),
            run=run,
        )
    ]
