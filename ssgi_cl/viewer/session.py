"""One tab without its page: the newest look that is asked for, and the pictures that answer it."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import monotonic, perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.core.lights import are_same
from ssgi_cl.core.srgb import BYTES
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.frame.result import Frame
from ssgi_cl.io.console import is_expected, one_line
from ssgi_cl.truth import metrics
from ssgi_cl.viewer.accumulation import Accumulation
from ssgi_cl.viewer.compose import false_colours, relative_error, wiped
from ssgi_cl.viewer.look import Look
from ssgi_cl.viewer.outputs import ERROR, OUTPUTS, Drawn, Job, lit_picture
from ssgi_cl.viewer.painter import Painter
from ssgi_cl.viewer.quality import Pace, moving_params, quick_params
from ssgi_cl.viewer.reference import Reference, Subject
from ssgi_cl.viewer.source import Source

_LOG = logging.getLogger("ssgi_cl.viewer")

SETTLE = 0.2
"""Seconds without a change until the still picture is drawn."""
REST = 0.4
"""Seconds from the still picture until it is refined: what moves again meanwhile is answered at once."""

Picture = NDArray[np.uint8]
Coarser = Callable[[FrameParams], FrameParams]


@dataclass(frozen=True, kw_only=True, eq=False)
class Shown:
    """A picture for the page.

    Attributes:
        picture: [rows, columns, 3] uint8 sRGB.
        moving: whether a better one follows.
        note: what the page says of it.
        frame: that it was made from, if any.
        exposure: of light, 0 of anything else.
        wall_ms: of drawing it.
        answers: number of the latest change that it answers.
    """

    picture: Picture
    moving: bool
    note: str
    frame: Frame | None
    exposure: float
    wall_ms: float
    answers: int


class Session:
    """What one tab sees.

    `change` may be called from any thread and as often as one likes: it replaces what is asked for. `step` and `close`
    are for the thread of the `RenderLoop`.

    Args:
        source: what is shown.
        look: the first look.
        runtime: the device.
        show: takes each picture; returns at once.
        say: takes what is wrong, or "" if nothing is.
        wake: has `step` called soon.
    """

    def __init__(
        self,
        source: Source,
        look: Look,
        runtime: Runtime,
        show: Callable[[Shown], None],
        say: Callable[[str], None],
        wake: Callable[[], None] = lambda: None,
    ) -> None:
        self.source = source
        self.runtime = runtime
        self.reference: Reference | None = None
        self._show, self._say, self._wake = show, say, wake
        self._lock = threading.Lock()
        self._look = look
        self._asked = 1
        self._news = False
        self._renewed = False
        self._closed = False
        # Of the thread that draws:
        self._painter = Painter(runtime)
        self._pace = Pace()
        self._answered = 0
        self._begun = False
        self._drawn: Drawn | None = None
        self._other: Drawn | None = None
        self._moved_at = 0.0
        self._still_at = 0.0
        self._accumulation = Accumulation()
        self._last: tuple[Look, int] = look, 0

    # ---- any thread

    @property
    def look(self) -> Look:
        """The newest look that is asked for."""
        return self._look

    def change(self, **changes: Any) -> int:
        """Ask for another look; return the number of the change."""
        with self._lock:
            self._look = replace(self._look, **changes)
            self._asked += 1
            asked = self._asked
        self._wake()
        return asked

    def renew(self, source: Source) -> None:
        """Show another source with the same look."""
        with self._lock:
            self.source, self._renewed = source, True
        self.stop_reference()
        self.change()

    def start_reference(self) -> None:
        """Have the reference of the present look made in the background.

        Raises:
            ValueError: there is none, of a G-buffer or of an output.
        """
        look = self._look
        if self.source.scene is None:
            raise ValueError("a G-buffer has no reference: expected a scene")
        if look.drawn not in ("picture", "ao"):
            raise ValueError(f"output is {look.output!r}: expected 'picture', 'ao' or 'error', which have a reference")
        params = look.settings.params
        radius = getattr(params.techniques(look.settings.radius)[0], "radius", look.settings.radius)
        self.stop_reference()
        subject = Subject(
            what="radiance" if look.drawn == "picture" else "ao",
            scene=self.source.scene,
            camera=look.pose.camera(*look.size),
            lights=look.shining,
            bounces=params.whole.bounces if params.whole is not None else 0,
            radius=radius,
        )
        self._reference_look = look
        self.reference = Reference(subject, self._on_news)

    def stop_reference(self) -> None:
        """Stop the reference, if one is being made."""
        if self.reference is not None:
            self.reference.stop()

    def _on_news(self) -> None:
        self._news = True
        self._wake()

    # ---- the thread that draws

    def step(self) -> float | None:
        """Draw one picture where one is due; return the seconds until the next is, None where nothing is."""
        if self._closed:
            return None
        with self._lock:
            look, asked = self._look, self._asked
            if self._renewed:
                self._painter.close()
                self._renewed = False
        try:
            return self._step(look, asked)
        except Exception as error:
            self._answered = asked
            self._still_at = monotonic()
            self._accumulation = Accumulation()
            self._drawn = None
            if not is_expected(error):
                _LOG.exception("a fault of the program")
            self._say(one_line(error) or type(error).__name__)
            return None

    def _step(self, look: Look, asked: int) -> float | None:
        now = monotonic()
        if asked != self._answered:
            begins, self._begun = not self._begun, True
            self._answered, self._still_at, self._drawn = asked, 0.0, None
            if self.source.scene is not None:
                self._moving(look, asked, quick_params if begins else moving_params)
                if begins:  # what takes longer to prepare comes next
                    self._answered = 0
                    return 0.0
                # From this picture on: a slow one gives no less time to the next request.
                self._moved_at = monotonic()
                return SETTLE
        if not self._still_at:
            if now < self._moved_at + SETTLE and self.source.scene is not None:
                return self._moved_at + SETTLE - now
            self._accumulation = Accumulation()
            self._still(look, asked)
            self._still_at = monotonic()
            return REST
        if self._drawn is None:  # it failed
            return None
        if self._news:
            self._news = False
            self._present(look, asked, False)
        refines = self.source.scene is not None and look.drawn == "picture" and not self._accumulation.done
        if not refines:
            return None
        if now < self._still_at + REST:
            return self._still_at + REST - now
        self._still(look, asked)
        return 0.0

    def _moving(self, look: Look, asked: int, coarser: Coarser) -> None:
        start = perf_counter()
        size = self._pace.size(*look.size)
        made = self._painter.made
        self._drawn = self._draw(look, size, coarser)
        self._other = self._draw_other(look, size, coarser)
        self._present(look, asked, True, start)
        if self._painter.made == made:  # preparations are not the pace of what follows
            self._pace.note((perf_counter() - start) * 1e3)

    def _still(self, look: Look, asked: int) -> None:
        start = perf_counter()
        drawn = self._draw(look, look.size, None)
        first = not self._accumulation.begun
        if first:
            self._other = self._draw_other(look, look.size, None)
        if self.source.scene is not None and drawn.kind == "light" and drawn.values is not None:
            exposure = drawn.exposure if first or self._drawn is None else self._drawn.exposure
            mean = self._accumulation.add(drawn.values, look.pose.camera(*look.size))
            if not first:  # the picture of the first is that of `render`, to the bit
                drawn = replace(drawn, values=mean, picture=None, exposure=exposure)
        self._drawn = drawn
        self._present(look, asked, False, start)

    def _draw(self, look: Look, size: tuple[int, int], coarser: Coarser | None) -> Drawn:
        params = look.settings.params
        camera = look.pose.camera(*size)
        if self.source.scene is not None and look.drawn == "picture" and coarser is None:
            camera = self._accumulation.camera(camera)
        output = OUTPUTS[look.drawn]
        if self.source.scene is None and not output.of_gbuffer:
            raise ValueError(f"output is {look.output!r}: a G-buffer has none; expected one without a scene's lights")
        job = Job(
            painter=self._painter,
            scene=self.source.scene,
            gbuffer=self.source.gbuffer,
            camera=camera,
            lights=look.shining,
            params=params if coarser is None else coarser(params),
            radius=look.settings.radius,
            encoded=coarser is not None,
        )
        return output.draw(job)

    def _draw_other(self, look: Look, size: tuple[int, int], coarser: Coarser | None) -> Drawn | None:
        if look.against != "B" or look.other is None:
            return None
        accumulation, self._accumulation = self._accumulation, Accumulation()
        try:
            return self._draw(replace(look.other, pose=look.pose), size, coarser)
        finally:
            self._accumulation = accumulation

    # ---- pictures

    def _present(self, look: Look, asked: int, moving: bool, start: float | None = None) -> None:
        """Make the picture of what was drawn, and show it."""
        drawn = self._drawn
        assert drawn is not None  # noqa: S101  called after a drawing
        begin = perf_counter() if start is None else start
        params = look.settings.params
        picture = drawn.encoded(params, self.runtime)
        notes = [f"{picture.shape[1]} x {picture.shape[0]}"]
        if self._accumulation.count and not moving:
            notes.append(f"mean of {self._accumulation.count} frames")
        reference = self._reference_of(look) if look.against == "reference" or look.output == ERROR else None
        if look.output == ERROR and not moving:
            picture = self._error(drawn, picture, look, reference, notes)
        right = self._right(look, drawn, reference, notes)
        if right is not None:
            picture = wiped(picture, right, look.wipe)
        wall_ms = (perf_counter() - begin) * 1e3
        notes.insert(1, f"{wall_ms:.0f} ms")
        self._last = look, asked
        self._show(
            Shown(
                picture=picture,
                moving=moving,
                note=", ".join(notes),
                frame=drawn.frame,
                exposure=drawn.exposure if drawn.kind == "light" else 0.0,
                wall_ms=wall_ms,
                answers=asked,
            )
        )
        self._say("")

    def _right(
        self, look: Look, drawn: Drawn, reference: NDArray[np.float32] | None, notes: list[str]
    ) -> Picture | None:
        """Return what is right of the wipe."""
        if look.against == "B":
            if self._other is None or look.other is None:
                notes.append("nothing is kept as B")
                return None
            return self._other.encoded(look.other.settings.params, self.runtime)
        if look.against != "reference" or reference is None:
            return None
        if drawn.kind == "light":
            return lit_picture(reference, drawn.exposure, look.settings.params, self.runtime)
        return Drawn(kind=drawn.kind, values=reference).encoded(look.settings.params, self.runtime)

    def _reference_of(self, look: Look) -> NDArray[np.float32] | None:
        """Return the mean of the reference if it is of what is seen."""
        reference = self.reference
        if reference is None or reference.latest is None:
            return None
        of = self._reference_look
        same = of.pose == look.pose and of.size == look.size and of.drawn == look.drawn
        return reference.latest[0] if same and are_same(of.shining, look.shining) else None

    def _error(
        self, drawn: Drawn, picture: Picture, look: Look, reference: NDArray[np.float32] | None, notes: list[str]
    ) -> Picture:
        """Return the relative error in false colours; note its figures."""
        if reference is None or drawn.values is None:
            notes.append("no reference of this view: start one")
            return picture
        error = relative_error(drawn.values, reference)
        assert self.reference is not None  # noqa: S101  it has a mean
        latest = self.reference.latest
        mean = float(np.abs(reference).mean())
        rmse = float(np.sqrt(np.mean((drawn.values - reference) ** 2))) / max(mean, 1e-30)
        notes.append(f"RMSE {rmse:.1%} of the mean")
        if latest is not None:
            notes.append(f"of which the reference has {latest[1]:.1%}")
        try:
            other = lit_picture(reference, drawn.exposure, look.settings.params, self.runtime)
            notes.append(f"FLIP {metrics.flip(BYTES[picture], BYTES[other]):.3f}")
        except MissingExtraError:
            notes.append("FLIP needs the extra truth")
        return false_colours(error)

    def still(self) -> tuple[Look, Drawn | None]:
        """Return the look and what was drawn last for it, to be saved."""
        return self._last[0], self._drawn

    def close(self) -> None:
        """Let go of all that it holds."""
        self._closed = True
        self.stop_reference()
        self._painter.close()
        self._drawn = self._other = None
        self._accumulation = Accumulation()
