"""Sequences of frames as test cases for what is reused of earlier ones: cameras, objects and lights that move."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from ssgi_cl.bench.experiments.shots.door import door_that_opens
from ssgi_cl.bench.experiments.shots.foliage import foliage_in_wind
from ssgi_cl.bench.experiments.shots.hall import hard_cut, path_through_the_hall, still_camera
from ssgi_cl.bench.experiments.shots.light_switched_off import light_that_switches_off
from ssgi_cl.bench.experiments.shots.shot import Shot
from ssgi_cl.bench.experiments.shots.turning_object import turning_object
from ssgi_cl.bench.experiments.shots.walk import walk_of_file, walk_of_scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import is_scene

SHOTS: Mapping[str, Callable[[Size, int], Iterator[Shot]]] = {
    "still camera": still_camera,
    "path through the hall": path_through_the_hall,
    "turning object": turning_object,
    "door that opens": door_that_opens,
    "foliage in wind": foliage_in_wind,
    "light switched off": light_that_switches_off,
    "hard cut": hard_cut,
}
"""By name."""


def shots_of(name: str, size: Size, frames: int, runtime: Runtime) -> Iterator[Shot]:
    """Return the frames of one of `SHOTS`, or of a walk through a built-in or generated scene or that of a file."""
    if name in SHOTS:
        return SHOTS[name](size, frames)
    return walk_of_scene(name, size, frames) if is_scene(name) else walk_of_file(name, size, frames, runtime)


__all__ = ["SHOTS", "Shot", "shots_of"]
