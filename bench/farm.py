"""Truths and measurements on the workers of Dask distributed: a scene at a size is a task.

What is held to one reference is in one task, so that none is made twice.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from ssgi_cl.core.errors import SequenceError, TruthError
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.sequences.cluster import connected
from ssgi_cl.sequences.frame_result import FrameResult
from ssgi_cl.sequences.map_frames import map_frames
from ssgi_cl.truth import store
from ssgi_cl.tuning.case import Case
from ssgi_cl.tuning.context import TruthSettings
from ssgi_cl.tuning.measured_scenes import views_of

from . import document, suite

MACHINE = "MACHINE"
"""Resource of the one worker of each machine that measures: it does one task at a time."""


class Place(NamedTuple):
    """A task: the cases of a scene at a size, and the scene as the command line gives it."""

    scene: str
    size: Size
    cases: tuple[Case, ...]

    def __str__(self) -> str:
        return f"{self.cases[0].scene}.{self.size[1]}x{self.size[0]}"


class Asked(NamedTuple):
    """What is asked for of every place; the fields are those of the commands' options."""

    truths: TruthSettings
    device: str | None
    meshes: Path | None
    lanes: int | None = None
    storage: str | None = None
    seconds: float = 1.0
    errors: bool = True
    pictures: bool = False


class Part(NamedTuple):
    """What a machine measured, and what `document.stamp` says of it."""

    stamp: dict[str, Any]
    found: suite.Measurements


def places_of(cases: Sequence[Case], scenes: dict[str, str]) -> list[Place]:
    """Return the tasks of cases as `suite.select` sorts them; `scenes` are by the names of their views."""
    grouped: dict[tuple[str, Size], list[Case]] = {}
    for case in cases:
        grouped.setdefault((case.scene, case.size), []).append(case)
    return [Place(scenes[scene], size, tuple(some)) for (scene, size), some in grouped.items()]


def make_truths(scheduler: str, places: Sequence[Place], asked: Asked, report: suite.Report) -> list[str]:
    """Make the references of places, as `suite.make_truths` does; return what could not be made and why.

    Raises:
        SequenceError: the cluster fails.
    """
    with closing(connected(scheduler)) as client:
        results = map_frames(
            _truths_at,
            places,
            arguments={"asked": asked, "folder": store.truth_folder().resolve()},
            client=client,
            progress=lambda done, total, left: report(f"{done} of {total} scenes", done / total),
        )
    failed = [f"{each.input}: {each.reason}" for each in results.failed]
    return [line for each in results for line in each.value or ()] + failed


def measure(
    scheduler: str, places: Sequence[Place], asked: Asked, report: suite.Report
) -> tuple[dict[str, Any], suite.Measurements]:
    """Measure places as `suite.measure` does, each on one of the workers with the resource MACHINE.

    Returns:
        What the machines are (`document.stamp`), and what was measured.

    Raises:
        SequenceError: the cluster fails, two of the workers share a machine, the machines are not alike, or nothing
            could be measured.
    """
    parts: dict[Place, Part] = {}
    skipped: list[dict[str, str]] = []

    def told(result: FrameResult) -> None:
        if result.state == "failed":
            skipped.extend({"name": case.name, "reason": result.reason} for case in result.input.cases)
        else:
            parts[result.input] = result.value

    interrupted = False
    with closing(connected(scheduler)) as client:
        _check_machines(client)
        try:
            map_frames(
                _measured_at,
                places,
                arguments={"asked": asked},
                client=client,
                resources={MACHINE: 1.0},
                progress=lambda done, total, left: report(f"{done} of {total} scenes", done / total),
                finished=told,
            )
        except KeyboardInterrupt:
            interrupted = True
    if not parts:
        raise SequenceError(f"nothing was measured: {skipped[0]['reason'] if skipped else 'interrupted'}")
    return _joined([parts[place] for place in places if place in parts], skipped, interrupted)


def _check_machines(client: Any) -> None:
    """Raise SequenceError if two workers that measure share a machine, and would disturb each other."""
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    hosts = Counter(each["host"] for each in workers if MACHINE in (each.get("resources") or {}))
    host, count = max(hosts.items(), key=lambda item: item[1], default=("", 0))
    if count > 1:
        raise SequenceError(
            f"{host} has {count} workers with the resource {MACHINE}: expected one a machine, for times are "
            "of a machine that does nothing else"
        )


def _joined(
    parts: list[Part], skipped: list[dict[str, str]], interrupted: bool
) -> tuple[dict[str, Any], suite.Measurements]:
    """Return the parts as one; SequenceError if machines differ in more than the time."""
    first, _ = parts[0]
    for stamp, _ in parts[1:]:
        for name, value in first.items():
            if name != "created" and stamp[name] != value:
                raise SequenceError(
                    f"the machines differ in {name}: {value} and {stamp[name]}; expected machines alike"
                )
    whole = suite.joined([part for _, part in parts])
    return first, replace(whole, skipped=skipped + whole.skipped, interrupted=interrupted)


def _truths_at(place: Place, *, asked: Asked, folder: Path) -> list[str]:
    """Make the references of a place, in a worker, which is to keep them in a folder."""
    if store.truth_folder().resolve() != folder:
        raise TruthError(
            f"this worker keeps truths in {store.truth_folder()}, not in {folder}: set SSGI_CL_CACHE of all to "
            "the same folder"
        )
    runtime = Runtime.open(asked.device)
    return suite.make_truths(place.cases, views_of([place.scene], runtime, asked.meshes), runtime, asked.truths)


def _measured_at(place: Place, *, asked: Asked) -> Part:
    """Measure the cases of a place, in a worker."""
    runtime = Runtime.open(asked.device, lanes=asked.lanes, storage=asked.storage)
    views = views_of([place.scene], runtime, asked.meshes)
    found = suite.measure(place.cases, views, runtime, truths=asked.truths, seconds=asked.seconds, errors=asked.errors)
    return Part(document.stamp(runtime), found if asked.pictures else replace(found, pictures={}))
