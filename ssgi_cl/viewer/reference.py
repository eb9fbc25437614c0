"""The reference of a look, made in the background pass by pass, with its standard error."""

from __future__ import annotations

import atexit
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Scene
from ssgi_cl.io.console import one_line
from ssgi_cl.truth import mitsuba_scene
from ssgi_cl.truth.radiance_tracer import MOST_BOUNCES, RadianceTracer
from ssgi_cl.truth.ray_ao import RayAo

Floats = NDArray[np.float32]
What = Literal["radiance", "ao"]

PASS_SAMPLES: dict[What, int] = {"radiance": 4, "ao": 16}
"""Paths or rays a pixel of a pass: the standard error comes from the spread of the passes."""
MOST_PASSES = 256

_ONE_AT_A_TIME = threading.Lock()
"""Mitsuba's variant is set for all threads of a process."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Subject:
    """What a reference is of.

    Attributes:
        what: all light of a frame, or ambient occlusion.
        bounces: reflections, of light; "all" or a number.
        radius: of ambient occlusion, scene units.
    """

    what: What
    scene: Scene
    camera: Camera
    lights: tuple[Light, ...]
    bounces: int | str = "all"
    radius: float = 1.0


class Estimate:
    """The mean of passes and its standard error."""

    def __init__(self) -> None:
        self.passes = 0
        self._sum: NDArray[np.float64] | None = None
        self._squares: NDArray[np.float64] | None = None

    def add(self, values: Floats) -> None:
        """Add the values of a pass."""
        wide = values.astype(np.float64)
        self._sum = wide if self._sum is None else self._sum + wide
        self._squares = wide**2 if self._squares is None else self._squares + wide**2
        self.passes += 1

    @property
    def mean(self) -> Floats:
        """Of all passes, as float32."""
        assert self._sum is not None  # noqa: S101  asked for after the first pass
        mean: Floats = (self._sum / self.passes).astype(np.float32)
        return mean

    @property
    def standard_error(self) -> float:
        """Root of the mean square over pixels of the standard error, as a share of the mean; infinite of one pass."""
        if self._sum is None or self._squares is None or self.passes < 2:
            return float("inf")
        mean = self._sum / self.passes
        variance = np.maximum(self._squares / self.passes - mean**2, 0.0) / (self.passes - 1)
        return float(np.sqrt(variance.mean()) / max(float(mean.mean()), 1e-30))


class Reference:
    """A thread that makes passes until it is stopped.

    Attributes:
        subject: what it is of.
        estimate: what was found so far, replaced as a whole.
        state: "running", "done", "stopped" or the message of an error.
    """

    def __init__(self, subject: Subject, news: Callable[[], None], *, most_passes: int = MOST_PASSES) -> None:
        self.subject = subject
        self.state = "running"
        self.latest: tuple[Floats, float, int] | None = None
        """The mean [rows, columns(, 3)], its standard error as a share of the mean, and the samples a pixel."""
        self._news = news
        self._most = most_passes
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ssgi reference", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Have no more passes begin; what was found stays."""
        self._stop.set()

    def join(self, timeout: float | None = None) -> None:
        """Wait for its end."""
        self._thread.join(timeout)

    @property
    def text(self) -> str:
        """What the page says of it."""
        unit = "paths" if self.subject.what == "radiance" else "rays"
        found = "" if self.latest is None else f"{self.latest[2]} {unit} a pixel, standard error {self.latest[1]:.1%}"
        return f"{self.state}{f': {found}' if found else ''}"

    def _finish(self) -> None:
        """Wait for the pass that is made now: a process that ends meanwhile is aborted."""
        self.stop()
        self.join(30.0)

    def _run(self) -> None:
        atexit.register(self._finish)
        estimate = Estimate()
        per_pass = PASS_SAMPLES[self.subject.what]
        try:
            with _ONE_AT_A_TIME:
                one_pass = self._passes()
            for number in range(self._most):
                if self._stop.is_set():
                    break
                with _ONE_AT_A_TIME:
                    estimate.add(one_pass(number))
                self.latest = estimate.mean, estimate.standard_error, estimate.passes * per_pass
                self._news()
            self.state = "stopped" if self._stop.is_set() else "done"
        except Exception as error:  # it ends here whatever it is, and the page says so
            self.state = f"failed: {one_line(error)}"
        atexit.unregister(self._finish)
        self._news()

    def _passes(self) -> Callable[[int], Floats]:
        """Return what makes a pass from its number."""
        subject, per_pass = self.subject, PASS_SAMPLES[self.subject.what]
        if subject.what == "ao":
            rays = RayAo(subject.scene)
            return lambda number: rays(subject.camera, subject.radius, per_pass, estimate_error=False, seed=number)[0]
        variant = mitsuba_scene.best_variant()
        most = MOST_BOUNCES if isinstance(subject.bounces, str) else subject.bounces
        with mitsuba_scene.within(variant):
            # Over each pixel's area, as the picture is once it is refined.
            tracer = RadianceTracer(subject.scene, subject.lights, variant, bounces=most, box_filter=True)

        def one_pass(number: int) -> Floats:
            with mitsuba_scene.within(variant):
                return tracer.image(subject.camera, per_pass, number)

        return one_pass
