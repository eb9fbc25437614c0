"""Sources and sessions of the window, without a browser."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import pytest

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.viewer.light_settings import LightState
from ssgi_cl.viewer.look import Look
from ssgi_cl.viewer.session import Session, Shown
from ssgi_cl.viewer.settings import Settings
from ssgi_cl.viewer.source import Source, open_source

SIZE = 96, 64


class Watched:
    """A session with what it showed and said."""

    def __init__(self, source: Source, runtime: Runtime, size: tuple[int, int] = SIZE) -> None:
        self.shown: list[Shown] = []
        self.said: list[str] = []
        self.session = Session(source, first_look(source, size), runtime, self.shown.append, self.said.append)

    def until_still(self, most: int = 40) -> Shown:
        """Draw until a still picture answers the latest change."""
        for _ in range(most):
            wait = self.session.step()
            if wait is None or (self.shown and not self.shown[-1].moving):
                return self.shown[-1]
            time.sleep(wait)
        raise AssertionError(f"no still picture after {most} steps")

    @property
    def error(self) -> str:
        """What was said last."""
        return self.said[-1] if self.said else ""


def first_look(source: Source, size: tuple[int, int] = SIZE) -> Look:
    lights = tuple(LightState(light=light) for light in source.lights)
    return Look(pose=source.pose, size=size, settings=Settings(source.radius), lights=lights)


@pytest.fixture(scope="session")
def box(runtime: Runtime) -> Source:
    return open_source("cornell_box", runtime)


@pytest.fixture
def watch(runtime: Runtime) -> Iterator[Callable[..., Watched]]:
    """Make sessions that are closed after the test."""
    made: list[Watched] = []

    def make(source: Source, size: tuple[int, int] = SIZE) -> Watched:
        made.append(Watched(source, runtime, size))
        return made[-1]

    yield make
    for each in made:
        each.session.close()
