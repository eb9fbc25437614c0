"""The way of pictures to a browser that is slow, gone, or has no storage."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from ssgi_cl.viewer.outlet import Outlet
from ssgi_cl.viewer.session import Shown


class Client:
    """Stands for a client of viser that answers when it is let."""

    def __init__(self, answer: Callable[[], None]) -> None:
        self.received: list[int] = []
        self._answer = answer
        self.scene = self.local_storage = self

    def set_background_image(self, picture: np.ndarray, **_: Any) -> None:
        self.received.append(int(picture[0, 0, 0]))

    def flush(self) -> None:
        pass

    def get_item(self, key: str, timeout: float) -> None:
        self._answer()


def shown(number: int) -> Shown:
    picture = np.full((2, 2, 3), number, np.uint8)
    return Shown(picture=picture, moving=True, note="", frame=None, exposure=1.0, wall_ms=0.0, answers=number)


def wait(ready: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30.0
    while not ready():
        assert time.monotonic() < deadline
        time.sleep(0.001)


def test_a_slow_client_loses_pictures_and_gets_the_newest() -> None:
    ready = threading.Semaphore(0)
    client = Client(lambda: ready.acquire())
    outlet = Outlet(client)
    outlet.offer(shown(0))
    wait(lambda: client.received == [0])
    for number in range(1, 200):
        outlet.offer(shown(number))
    ready.release()
    wait(lambda: len(client.received) == 2)
    assert client.received == [0, 199]
    assert outlet.dropped == 198
    ready.release()
    wait(lambda: outlet.answered[0] == 199)
    outlet.close()


@pytest.mark.parametrize("error", [RuntimeError("no storage"), TimeoutError("asleep")])
def test_a_client_without_an_answer_gets_the_next_picture(error: Exception) -> None:
    def fail() -> None:
        raise error

    client = Client(fail)
    outlet = Outlet(client)
    for number in range(3):
        outlet.offer(shown(number))
        wait(lambda: len(client.received) == number + 1)  # noqa: B023  called within the turn
    outlet.close()
    outlet._thread.join(10.0)
    assert not outlet._thread.is_alive()
