"""Time and error of a technique with given parameters, over several views at once."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.params import parameter_fields
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.techniques.technique import Technique
from ssgi_cl.truth import metrics
from ssgi_cl.tuning.calibration import GatherLoad
from ssgi_cl.tuning.context import Context

METRICS: dict[str, Callable[..., float]] = {
    "rmse": metrics.rmse,
    "mrse": metrics.mrse,
    "p99": metrics.p99,
    "flip": metrics.flip,
}
"""Errors that may be minimised; of several views their geometric mean."""

RUNS = 3
"""Repetitions of a first, rough time, at most."""
ENOUGH_MS = 50.0
"""Of a device's time: a rough time ends when the repetitions took this long."""
TOO_SLOW = 3.0
"""Times a limit: where the first view takes so long, the others are not looked at."""
CAREFUL_RUNS = 25
CAREFUL_MS = 400.0
"""Repetitions, and device time, of what decides, at most."""
FEWEST_RUNS = 3
REFERENCE_RUNS = 50


def geometric_mean(errors: Sequence[float]) -> float:
    """Return the geometric mean: a scene whose error is large anyway says no more than others."""
    return math.prod(errors) ** (1.0 / len(errors))


@dataclass(frozen=True)
class Trial:
    """Time and error of some parameters.

    Attributes:
        parameters: those that were varied.
        ms: device time of a picture, mean over the views, milliseconds.
        error: geometric mean over the views; None where the time alone ruled it out.
    """

    parameters: Mapping[str, Any]
    ms: float
    error: float | None


class Trials:
    """A technique on some views, each parameter set measured once.

    Args:
        entry: the technique.
        contexts: the views, all of one device and size.
        fixed: parameters that are the same in every trial; `radius` is the view's without.
        metric: key in `METRICS`.
        layers, overscan: of the G-buffers.
    """

    def __init__(
        self,
        entry: Technique,
        contexts: Sequence[Context],
        fixed: Mapping[str, Any],
        metric: str,
        layers: int = 1,
        overscan: float = 0.0,
    ) -> None:
        self._entry = entry
        self._contexts = contexts
        self._gbuffers = [context.layered(layers, overscan) for context in contexts]
        self._fixed = dict(fixed)
        self._metric = METRICS[metric]
        self._runtime = contexts[0].runtime
        self._takes_radius = "radius" in parameter_fields(entry.params)
        self._reference = GatherLoad(self._runtime)
        # Ratios to the reference become milliseconds by its least time: what else the machine
        # does only slows it down.
        self._reference_ms = min(self._device_ms(self._reference.run) for _ in range(REFERENCE_RUNS))
        self._kept: dict[tuple[tuple[str, Any], ...], Trial] = {}

    def prepare(self) -> None:
        """Make G-buffers and truths of all views."""
        for context in self._contexts:
            self._truth(context)

    @property
    def tried(self) -> list[Trial]:
        """All trials, in the order in which they were first made."""
        return list(self._kept.values())

    def measure(self, parameters: Mapping[str, Any], limit_ms: float = math.inf) -> Trial:
        """Return time, roughly, and error; no error beyond `limit_ms`."""
        key = tuple(sorted(parameters.items()))
        kept = self._kept.get(key)
        if kept is not None and (kept.error is not None or kept.ms > limit_ms):
            return kept
        if kept is None:
            ms, images = self._rough(parameters, limit_ms)
        else:
            ms, images = kept.ms, self.images(parameters)
        error = self._error(images) if ms <= limit_ms else None
        trial = self._kept[key] = Trial(dict(parameters), ms, error)
        return trial

    def confirm(self, trial: Trial) -> Trial:
        """Return a trial with its time measured again, longer, which replaces the first."""

        def run() -> None:
            self.images(trial.parameters)

        run()  # the caches know it, as they do in a row of frames
        confirmed = Trial(trial.parameters, self._device_ms_of(run, CAREFUL_RUNS, CAREFUL_MS, FEWEST_RUNS), trial.error)
        self._kept[tuple(sorted(trial.parameters.items()))] = confirmed
        return confirmed

    def images(
        self, parameters: Mapping[str, Any], gbuffers: Sequence[DeviceGBuffer] | None = None
    ) -> list[NDArray[np.float32]]:
        """Return the technique's result on each view, or on other G-buffers of the views."""
        return [
            self._image(context, gbuffer, parameters)
            for context, gbuffer in zip(self._contexts, gbuffers or self._gbuffers, strict=True)
        ]

    def _image(self, context: Context, gbuffer: DeviceGBuffer, parameters: Mapping[str, Any]) -> NDArray[np.float32]:
        values = {**self._fixed, **parameters}
        if self._takes_radius:
            values.setdefault("radius", context.radius)
        image: NDArray[np.float32] = self._entry.function(gbuffer, runtime=self._runtime, **values)
        return image

    def error(self, parameters: Mapping[str, Any], gbuffers: Sequence[DeviceGBuffer] | None = None) -> float:
        """Return the geometric mean over the views of the error against the world truth."""
        return self._error(self.images(parameters, gbuffers))

    def errors(self, parameters: Mapping[str, Any], gbuffers: Sequence[DeviceGBuffer] | None = None) -> list[float]:
        """Return the error against the world truth on each view."""
        return self._errors(self.images(parameters, gbuffers))

    def _error(self, images: Sequence[NDArray[np.float32]]) -> float:
        return geometric_mean(self._errors(images))

    def _errors(self, images: Sequence[NDArray[np.float32]]) -> list[float]:
        return [
            self._metric(image, self._truth(context), context.seen)
            for image, context in zip(images, self._contexts, strict=True)
        ]

    def _truth(self, context: Context) -> NDArray[np.float32]:
        truth: NDArray[np.float32] = getattr(context, self._entry.quantity)().mean
        return truth

    def _rough(self, parameters: Mapping[str, Any], limit_ms: float) -> tuple[float, list[NDArray[np.float32]]]:
        """Return milliseconds and the images; none of what is much too slow."""
        first, gbuffer = self._contexts[0], self._gbuffers[0]
        self._image(first, gbuffer, parameters)  # the first run compiles
        alone = self._device_ms(lambda: self._image(first, gbuffer, parameters))
        if alone > TOO_SLOW * limit_ms:
            return alone, []
        images: list[NDArray[np.float32]] = []

        def run() -> None:
            images[:] = self.images(parameters)

        return self._device_ms_of(run, RUNS, ENOUGH_MS), images

    def _device_ms_of(self, run: Callable[[], object], most: int, enough_ms: float, fewest: int = 1) -> float:
        """Return milliseconds of a picture, mean over the views that `run` computes.

        Median of the ratios of device times to a reference load's beside, of at most `most`
        repetitions that take about `enough_ms` together, and at least `fewest`.
        """
        ratios: list[float] = []
        took = 0.0
        while len(ratios) < fewest or (len(ratios) < most and took < enough_ms):
            beside = self._device_ms(self._reference.run)
            ms = self._device_ms(run)
            ratios.append(ms / beside)
            took += ms
        return statistics.median(ratios) * self._reference_ms / len(self._contexts)

    def _device_ms(self, run: Callable[[], object]) -> float:
        with self._runtime.frame():
            run()
            return sum(entry.ms for entry in self._runtime.times())
