"""Selection and measurement of cases."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import MissingExtraError, SsgiError, TruthError
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import BuiltinScene
from ssgi_cl.tuning.calibration import Calibration, GatherLoad
from ssgi_cl.tuning.case import Case, Family, Subject
from ssgi_cl.tuning.context import Context, TruthSettings
from ssgi_cl.tuning.measure import UNTIMED, Stopwatch, Timing

from .cases import FAMILIES
from .errors import errors_of

Report = Callable[[str, float], object]
"""Called with what is under way and the share of all that is done."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """Result and truths of a case: linear, [rows, columns] or [rows, columns, 3]."""

    result: NDArray[np.float32]
    world: NDArray[np.float32] | None
    assumption: NDArray[np.float32] | None
    seen: NDArray[np.bool_]


@dataclass
class Measurements:
    """Results of a run of the benchmark; see `document` for the form of the entries.

    `interrupted`: whether Ctrl-C ended it before all cases were measured.
    """

    calibration: Calibration
    reference_ms: float
    results: list[dict[str, Any]] = field(default_factory=list)
    skipped: list[dict[str, str]] = field(default_factory=list)
    pictures: dict[str, Pictures] = field(default_factory=dict)
    interrupted: bool = False


def select(
    patterns: Sequence[str], scenes: Sequence[str], sizes: Sequence[Size], families: Mapping[str, Family] = FAMILIES
) -> list[Case]:
    """Return the cases that any pattern fits, by scene and size; all of them without patterns.

    Args:
        patterns: names of cases in which * and ? stand for any characters, and of which later
            parts may be left out; without * and ? it may ask for an unusual setting and size.
        scenes, sizes: what the usual cases are on.
        families: what there is.

    Raises:
        ValueError: a pattern fits nothing.
    """
    usual = [
        Case(family, setting, scene, size)
        for scene in scenes
        for size in sizes
        for family, maker in families.items()
        for setting in maker.SETTINGS
    ]
    if not patterns:
        return usual
    chosen: dict[Case, None] = {}
    for pattern in patterns:
        fitting = [case for case in usual if _fits(case.name, pattern)]
        if not fitting:
            fitting = _unusual(pattern, scenes, sizes, families)
        if not fitting:
            raise ValueError(
                f"case is {pattern!r}: fits none; families are {', '.join(families)}, scenes "
                f"{', '.join(scenes)} (--scene asks for others), and a name is "
                "family.setting.scene.COLUMNSxROWS"
            )
        chosen.update(dict.fromkeys(fitting))
    # Together what shares a scene and a size, as `_in_context` keeps one context at a time.
    places = list(dict.fromkeys((case.scene, case.size) for case in chosen))
    return sorted(chosen, key=lambda case: places.index((case.scene, case.size)))


def _unusual(pattern: str, scenes: Sequence[str], sizes: Sequence[Size], families: Mapping[str, Family]) -> list[Case]:
    """Return the cases of a name without wildcards, whatever their setting and size."""
    family, *rest = pattern.split(".")
    if family not in families or not rest or any(letter in pattern for letter in "*?["):
        return []
    if len(rest) == 3:
        case = Case.parse(pattern)
        return [case] if case.scene in scenes else []
    return [
        Case(family, rest[0], scene, size) for scene in scenes for size in sizes if len(rest) == 1 or rest[1] == scene
    ]


def _fits(name: str, pattern: str) -> bool:
    """Return whether a pattern fits a name, or its first parts: `ssao` means all that begin so."""
    return fnmatch.fnmatchcase(name, pattern) or fnmatch.fnmatchcase(name, pattern + ".*")


def measure(
    cases: Sequence[Case],
    views: Mapping[str, BuiltinScene],
    runtime: Runtime,
    *,
    truths: TruthSettings | None = None,
    seconds: float = 1.0,
    runs: int | None = None,
    errors: bool = True,
    families: Mapping[str, Family] = FAMILIES,
    report: Report = lambda text, share: None,
) -> Measurements:
    """Measure time and error of cases.

    A case that can't run is listed with the reason; the others go on. Ctrl-C ends the run; what was
    measured until then is returned.

    Args:
        cases: what `select` returns.
        views: the scenes by name.
        runtime: the device.
        truths: how good the truths are.
        seconds, runs: how long, or how often, each case is repeated.
        errors: whether to hold results to truths at all.
        families: what makes the cases.
        report: called as the work goes on.
    """
    report("calibration", 0.0)
    watch = Stopwatch(runtime, seconds, runs)
    found = Measurements(Calibration.of(runtime), 0.0)
    for case, context in _in_context(cases, views, runtime, truths, report):
        family = families[case.family]
        why = family.missing()
        if not why:
            try:
                _one(case, context, family, watch, found, errors)
            except (SsgiError, ValueError, RuntimeError) as error:  # peers raise what they like
                why = _line(error)
            except KeyboardInterrupt:
                found.interrupted = True
                break
        if why:
            found.skipped.append({"name": case.name, "reason": why})
    if watch.reference_ms:
        found.reference_ms = float(np.median(watch.reference_ms))
    return found


def joined(parts: Sequence[Measurements]) -> Measurements:
    """Return parts of a run as one, with the calibration of the first; at least one part."""
    whole = replace(parts[0], results=[], skipped=[], pictures={}, interrupted=any(part.interrupted for part in parts))
    for part in parts:
        whole.results += part.results
        whole.skipped += part.skipped
        whole.pictures |= part.pictures
    whole.reference_ms = float(np.median([part.reference_ms for part in parts]))
    return whole


def make_truths(
    cases: Sequence[Case],
    views: Mapping[str, BuiltinScene],
    runtime: Runtime,
    truths: TruthSettings,
    *,
    families: Mapping[str, Family] = FAMILIES,
    report: Report = lambda text, share: None,
) -> list[str]:
    """Make what cases are held to, unless it is kept; return what could not be made and why."""
    wrong = []
    for case, context in _in_context(cases, views, runtime, truths, report):
        family = families[case.family]
        if family.missing():
            continue
        try:
            for make in family.prepare(context, case.setting).truths.values():
                make()
        except (SsgiError, ValueError) as error:
            wrong.append(f"{case.name}: {_line(error)}")
    return wrong


def entries(found: Measurements, truths: TruthSettings, seconds: float) -> dict[str, Any]:
    """Return the part of a document that comes from measuring."""
    return {
        "options": {
            "truth_rays": truths.rays,
            "truth_paths": truths.paths,
            "truth_points": truths.points,
            "attenuation": truths.attenuation,
            "seconds": seconds,
        },
        "calibration": asdict(found.calibration),
        "reference": {"name": GatherLoad.name, "ms": found.reference_ms},
        "results": found.results,
        "skipped": found.skipped,
    }


def _in_context(
    cases: Sequence[Case],
    views: Mapping[str, BuiltinScene],
    runtime: Runtime,
    truths: TruthSettings | None,
    report: Report,
) -> Iterator[tuple[Case, Context]]:
    """Give each case with what it shares with others of its scene and size."""
    context, of = None, None
    for index, case in enumerate(cases):
        report(case.name, index / len(cases))
        if context is None or of != (case.scene, case.size):
            # One at a time, so that memory holds the arrays of one scene.
            context = Context(runtime, views[case.scene], case.size, truths)
            of = (case.scene, case.size)
        context.progress = _within(report, index, len(cases))
        yield case, context
    report("", 1.0)


def _within(report: Report, index: int, count: int) -> Report:
    """Return what reports the progress of one part of `count` as that of the whole."""
    return lambda text, share: report(f"{text} {100.0 * share:.0f} %", (index + share) / count)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())


def _one(
    case: Case, context: Context, family: Family, watch: Stopwatch, found: Measurements, with_errors: bool
) -> None:
    subject = family.prepare(context, case.setting)
    timing = UNTIMED
    if subject.timed:
        # Where on the device memory lies matters; other programs take long to be made anew.
        again = (lambda: family.prepare(context, case.setting)) if subject.on_device else None
        timing = watch.time(subject, again)
    errors: dict[str, Any] = {}
    whole = subject.quantity == "radiance"  # of which the sky is a part
    seen = np.ones_like(context.seen) if whole else context.seen
    if with_errors and subject.image is not None and subject.truths and seen.any():
        image = subject.image()
        means = {}
        for name, make in subject.truths.items():
            try:
                truth = make()
            except (MissingExtraError, TruthError) as error:  # the time is worth having without it
                what = f"{name} truth of {case.name}"
                found.skipped.append({"name": what, "reason": _line(error)})
                continue
            if np.isfinite(truth.mean).all():  # with holes it makes no picture
                means[name] = truth.mean
            errors[name] = errors_of(
                image,
                truth,
                seen,
                context.regions,
                light=subject.quantity not in ("occlusion", "model", ""),
                picture=whole,
                smooth=context.smooth_surfaces,
            )
        if subject.quantity != "bent":  # whose angles are no picture
            found.pictures[case.name] = Pictures(image, means.get("world"), means.get("assumption"), seen)
    found.results.append(_entry(case, subject, timing, errors))


def _entry(case: Case, subject: Subject, timing: Timing, errors: dict[str, Any]) -> dict[str, Any]:
    clock = timing.device_ms or timing.wall_ms
    return {
        "name": case.name,
        "family": case.family,
        "setting": case.setting,
        "scene": case.scene,
        "size": list(case.size),
        "quantity": subject.quantity,
        "counted": subject.counted,
        "note": subject.note,
        "timed": subject.timed,
        "wall_ms": asdict(timing.wall_ms),
        "device_ms": asdict(timing.device_ms) if timing.device_ms else None,
        "runs": timing.runs,
        "ratio": asdict(timing.ratio),
        "unsteady": timing.unsteady,
        "samples_g_s": 1e-6 * subject.samples / clock.median if subject.samples else None,
        "moved_gb_s": 1e-6 * subject.moved / clock.median if subject.moved else None,
        "passes": [{"name": name, "ms": ms} for name, ms in timing.passes.items()],
        "skipped_passes": [{"name": name, "reason": why} for name, why in timing.skipped.items()],
        "errors": errors,
        "front": False,
        "near": False,
    }
