"""The way of pictures to one browser: the newest one, once the browser has dealt with the one before."""

from __future__ import annotations

import threading
from contextlib import suppress
from time import monotonic
from typing import Any

from ssgi_cl.viewer.session import Shown

MOVING_QUALITY, STILL_QUALITY = 80, 92
"""Of JPEG."""
PATIENCE = 5.0
"""Seconds after which a picture is sent to a browser that does not answer."""
_KEY = "ssgi-received"


class Outlet:
    """Sends pictures to a client of viser from a thread of its own.

    A browser is asked for an answer after each picture, and gets the next one then. What comes meanwhile replaces what
    waits: a slow client loses pictures and is never behind.

    Attributes:
        sent, dropped: pictures so far.
        latest: that was sent.
        answered: number of the change that the browser has seen the answer to, and when (`monotonic`).
    """

    def __init__(self, client: Any) -> None:
        self.sent = self.dropped = 0
        self.latest: Shown | None = None
        self.answered = 0, 0.0
        self._client = client
        self._waiting: Shown | None = None
        self._condition = threading.Condition()
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="ssgi outlet", daemon=True)
        self._thread.start()

    def offer(self, shown: Shown) -> None:
        """Have a picture sent as soon as the browser is ready; returns at once."""
        with self._condition:
            self.dropped += self._waiting is not None
            self._waiting = shown
            self._condition.notify()

    def close(self) -> None:
        """Send no more."""
        with self._condition:
            self._closed = True
            self._waiting = None
            self._condition.notify()

    def _run(self) -> None:
        while True:
            with self._condition:
                while self._waiting is None and not self._closed:
                    self._condition.wait()
                if self._closed:
                    return
                shown, self._waiting = self._waiting, None
            assert shown is not None  # noqa: S101  the loop above ended
            quality = MOVING_QUALITY if shown.moving else STILL_QUALITY
            self._client.scene.set_background_image(shown.picture, format="jpeg", jpeg_quality=quality)
            self._client.flush()
            self.sent += 1
            self.latest = shown
            with suppress(RuntimeError, TimeoutError):  # it has no such storage, is gone, or sleeps
                self._client.local_storage.get_item(_KEY, timeout=PATIENCE)
            self.answered = shown.answers, monotonic()
