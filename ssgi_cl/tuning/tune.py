"""Find the parameters of a technique for the least error in a time, or the least time for an error.

The truth is cast rays; what is tuned on some scenes is reported on others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from ssgi_cl.core import checks
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.core.names import AoTechnique
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.progress import told_steps
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.view import MOST_LAYERS
from ssgi_cl.rasterize.scenes import BuiltinScene
from ssgi_cl.techniques.technique import Technique
from ssgi_cl.truth.raycast import embree_version
from ssgi_cl.tuning.context import Context, Progress, TruthSettings
from ssgi_cl.tuning.outcome import Bound, TuneError, Tuning
from ssgi_cl.tuning.search import Cost, narrow
from ssgi_cl.tuning.trials import METRICS, Trial, Trials
from ssgi_cl.tuning.tunables import axis_of, described, entry_of, views_of, within
from ssgi_cl.version import __version__

__all__ = ["Session", "TuneError", "Tuning", "tune"]

SIZE = (300, 400)

FINALISTS = 5
"""Number of the best that are timed carefully before one is chosen."""

SLACK = 1.3
"""Factor over a time limit up to which the error of a point is measured: searching needs to
know what lies just beyond."""


@checked_keywords
def tune(
    technique: AoTechnique,
    *,
    budget_ms: float | None = None,
    max_error: float | None = None,
    scenes: Sequence[str | BuiltinScene] | None = None,
    size: Size = SIZE,
    parameters: Mapping[str, Sequence[Any]] | None = None,
    fixed: Mapping[str, Any] | None = None,
    metric: str = "rmse",
    layers: int = 1,
    overscan: float = 0.0,
    rounds: int = 4,
    seed: int = 0,
    runtime: Runtime | None = None,
    progress: Progress | bool | None = None,
) -> Tuning:
    """Search a technique's parameters, held to ray-cast truth on several scenes and views.

    Exactly one of `budget_ms` and `max_error` is given. Times are medians on this device, taken
    beside a reference, so that what slows the machine down for a while cancels.

    Args:
        technique: key in `TECHNIQUES`, such as "ssao".
        budget_ms: the least error within this device time for a picture is looked for, > 0.
        max_error: the least time with at most this error is looked for, > 0.
        scenes: names, or scenes; all of their views count. By default the first view of each of
            `TUNED_ON`. The names in `REPORTED` and `VALIDATED_ON` are refused; who insists gives
            the scene itself, such as `hall()`.
        size: (rows, columns) of the pictures.
        parameters: what is varied: name -> (low, high), or a list of values; by default what the
            technique's entry calls worth tuning.
        fixed: name -> value of what is not varied and not the default either. The radius is each
            scene's own unless it is given here.
        metric: key in `METRICS`.
        layers, overscan: of the G-buffers; see `rasterize.gbuffer`.
        rounds: 1 to 10; the first is spread over all, each further one halves what it looks at.
        seed: chooses the points of the first round.
        runtime: the device; by default the fastest found.
        progress: called with what is under way and the share of it that is done. True: a bar in terminals and
            notebooks.

    Raises:
        TypeError, ValueError: an argument is wrong; the message says which and what is allowed.
        TuneError: nothing keeps the bound.
        MissingExtraError: the extra `truth` is not installed.
    """
    entry = entry_of(technique)
    if (budget_ms is None) == (max_error is None):
        raise ValueError(f"budget_ms is {budget_ms} and max_error is {max_error}: expected exactly one of them")
    if budget_ms is not None:
        budget_ms = checks.number("budget_ms", budget_ms, low=0.0, above=True, unit="ms")
    else:
        max_error = checks.number("max_error", max_error, low=0.0, above=True)
    checks.integer("rounds", rounds, low=1, high=10)
    checks.integer("seed", seed, low=0, high=2**31)
    embree_version()  # errors are measured against cast rays: without them there is no use in the rest
    with told_steps(progress, "tuning") as tell:
        session = Session(
            entry,
            views_of(scenes),
            size=size,
            parameters=parameters,
            fixed=fixed,
            metric=metric,
            layers=layers,
            overscan=overscan,
            runtime=runtime,
            progress=tell,
        )
        return session.tune(budget_ms, max_error, rounds=rounds, seed=seed)


class Session:
    """Views, truths and trials of one technique: several searches may share them.

    Args:
        entry, views: as `entry_of` and `views_of` return them; the rest as in `tune`.
    """

    def __init__(
        self,
        entry: Technique,
        views: Sequence[BuiltinScene],
        *,
        size: Size = SIZE,
        parameters: Mapping[str, Sequence[Any]] | None = None,
        fixed: Mapping[str, Any] | None = None,
        metric: str = "rmse",
        layers: int = 1,
        overscan: float = 0.0,
        runtime: Runtime | None = None,
        progress: Progress | None = None,
    ) -> None:
        self._entry = entry
        self._views = views
        self._metric = checks.choice("metric", metric, tuple(METRICS))
        self._fixed = dict(fixed or {})
        varied = entry.tunable if parameters is None else parameters
        self._axes = [
            axis_of(entry.params, name, values)
            for name, values in varied.items()
            if parameters is not None or name not in self._fixed
        ]
        twice = sorted({axis.name for axis in self._axes} & set(self._fixed))
        if twice:
            raise ValueError(f"{twice[0]} is in parameters and in fixed: expected it in one")
        if not self._axes:
            raise ValueError("parameters is empty: expected at least one to vary")
        usual = entry.params(**self._fixed)
        self._start = {axis.name: within(axis, getattr(usual, axis.name)) for axis in self._axes}
        self._size = (
            checks.integer("size[0]", size[0], low=1, high=16384, unit="px"),
            checks.integer("size[1]", size[1], low=1, high=16384, unit="px"),
        )
        self._runtime = runtime or Runtime.open()
        self._truth = TruthSettings()
        self._progress = progress
        self._contexts = [Context(self._runtime, view, self._size, self._truth) for view in views]
        for context in self._contexts:
            context.progress = progress or context.progress
        layers = checks.integer("layers", layers, low=1, high=MOST_LAYERS)
        self._layers, self._overscan = layers, overscan
        self.trials = Trials(entry, self._contexts, self._fixed, metric, layers, overscan)
        self.trials.prepare()

    def tune(self, budget_ms: float | None, max_error: float | None, *, rounds: int = 4, seed: int = 0) -> Tuning:
        """Search as `tune` does, with what is known from former searches.

        Raises:
            ValueError: the technique refuses all that was tried.
            TuneError: nothing keeps the bound.
        """
        bound = Bound(budget_ms, max_error)
        self.explore(bound, rounds=rounds, seed=seed)
        # Times were rough: what seems just too slow may do, and the other way round.
        promising = sorted((trial for trial in self._complete() if bound.nearly_kept_by(trial)), key=bound.rank)
        for group in range(0, len(promising), FINALISTS):
            confirmed = [self.trials.confirm(trial) for trial in promising[group : group + FINALISTS]]
            kept = [trial for trial in confirmed if bound.kept_by(trial)]
            if kept:
                return self._tuning(bound, min(kept, key=bound.cost))
        raise TuneError(bound.unreachable(self.trials.tried, self._metric))

    def explore(self, bound: Bound, *, rounds: int, seed: int = 0) -> None:
        """Try what may be the best within a bound.

        Raises:
            ValueError: the technique refuses all that was tried.
        """
        total = 64 + 40 * (rounds - 1) + 12 * len(self._axes)  # trials of a search, roughly
        before = len(self.trials.tried)
        refused: list[ValueError] = []

        def cost(values: dict[str, Any]) -> Cost | None:
            try:
                self._entry.params(**self._fixed, **values)
            except ValueError as error:  # one parameter may rule another out
                refused.append(error)
                return None
            trial = self.trials.measure(values, bound.limit_ms * SLACK)
            if self._progress is not None:
                share = min((len(self.trials.tried) - before) / total, 1.0)
                self._progress("trials", share)
            result = bound.cost(trial)
            bound.best = result if bound.best is None else min(bound.best, result)
            return result

        known = [dict(trial.parameters) for trial in self._complete()]
        narrow(self._axes, cost, start=[self._start, *known], rounds=rounds, seed=seed)
        if refused and not self._complete():
            raise refused[-1]

    def _complete(self) -> list[Trial]:
        """Return the trials that name all that is varied."""
        names = {axis.name for axis in self._axes}
        return [trial for trial in self.trials.tried if set(trial.parameters) == names]

    def _tuning(self, bound: Bound, best: Trial) -> Tuning:
        assert best.error is not None  # noqa: S101  it keeps the bound
        chosen = {**self._fixed, **best.parameters}
        return Tuning(
            budget_ms=bound.budget_ms,
            max_error=bound.max_error,
            best=self._entry.params(**chosen),
            parameters=chosen,
            ms=best.ms,
            error=best.error,
            tried=tuple(self.trials.tried),
            **self.setting(),
        )

    def setting(self) -> dict[str, Any]:
        """Return what all results depend on, as a `Tuning` has it."""
        return {
            "technique": self._entry.name,
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "version": __version__,
            "device": self._runtime.info.label,
            "variant": str(self._runtime.variant),
            "size": self._size,
            "layers": self._layers,
            "overscan": self._overscan,
            "metric": self._metric,
            "truth": {"rays": self._truth.rays, "attenuation": self._truth.attenuation, "weighting": "cosine"},
            "scenes": tuple(described(self._views, self._fixed.get("radius"))),
        }
