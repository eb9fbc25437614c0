"""The one thread that draws for all tabs, in turn."""

from __future__ import annotations

import atexit
import logging
import threading
from collections.abc import Callable
from time import monotonic

from ssgi_cl.viewer.session import Session

_LOG = logging.getLogger("ssgi_cl.viewer")


class RenderLoop:
    """Calls `Session.step` of each session while there is something to draw, and sleeps else.

    Each session draws one picture before it is the next one's turn. A session holds the newest request alone, so that
    none pile up.
    """

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._sessions: list[Session] = []
        self._tasks: list[Callable[[], None]] = []
        self._awake = False
        self._ended = False
        self._thread = threading.Thread(target=self._run, name="ssgi render loop", daemon=True)
        self._thread.start()
        # A process that ends while a driver works in a thread is aborted.
        atexit.register(self.end)

    def add(self, session: Session) -> None:
        """Draw for a session from now on."""
        with self._condition:
            self._sessions.append(session)
        self.wake()

    def remove(self, session: Session) -> None:
        """Draw no more for a session, and close it."""

        def gone() -> None:
            if session in self._sessions:
                self._sessions.remove(session)
            session.close()

        self.do(gone)

    def do(self, task: Callable[[], None]) -> None:
        """Run something once between two pictures."""
        with self._condition:
            self._tasks.append(task)
        self.wake()

    def wake(self) -> None:
        """Have it look for something to draw."""
        with self._condition:
            self._awake = True
            self._condition.notify()

    def end(self) -> None:
        """End the thread after the picture that it draws now; close all sessions."""
        atexit.unregister(self.end)
        with self._condition:
            self._ended = True
            self._condition.notify()
        self._thread.join(30.0)
        for session in self._sessions:
            session.close()
        self._sessions.clear()

    def _run(self) -> None:
        due = monotonic()
        while True:
            with self._condition:
                while not self._awake and not self._ended and due > monotonic():
                    self._condition.wait(min(due - monotonic(), 3600.0))
                if self._ended:
                    return
                self._awake = False
                tasks, self._tasks = self._tasks, []
                sessions = list(self._sessions)
            for task in tasks:
                try:
                    task()
                except Exception:  # the other tabs go on
                    _LOG.exception("a fault of the program")
            waits = [session.step() for session in sessions]
            due = min((monotonic() + wait for wait in waits if wait is not None), default=float("inf"))
