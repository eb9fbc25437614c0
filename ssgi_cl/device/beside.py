"""A second queue: kernels that run beside what follows them, while that waits for the host."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ssgi_cl.device.opencl import opencl

if TYPE_CHECKING:
    from ssgi_cl.device.runtime import Runtime


class Beside:
    """The kernels of a `with` statement of `SecondQueue.kernels`."""

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._done: Any = None

    def ended(self, event: Any) -> None:
        """Note the event after which all are done."""
        self._done = event

    def join(self) -> None:
        """Have all that is queued from now on wait for them."""
        if self._done is not None:
            opencl().enqueue_barrier(self._runtime.queue, wait_for=[self._done])
            self._done = None


class SecondQueue:
    """The queue of a device that work of long standing goes to.

    Args:
        runtime: the device.
    """

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime
        self._queue: Any = None

    @contextmanager
    def kernels(self) -> Iterator[Beside]:
        """Queue the kernels within so that they begin after all that is queued before, and run beside what is queued
        afterwards, until `Beside.join`. Arrays that they read and write are to be left alone until then; they read no
        planes, of which there may be copies to make.
        """
        cl, runtime = opencl(), self._runtime
        if self._queue is None:
            self._queue = cl.CommandQueue(runtime.context, runtime.device, properties=runtime.queue.properties)
        before = cl.enqueue_marker(runtime.queue)
        runtime.queue.flush()
        cl.enqueue_barrier(self._queue, wait_for=[before])
        beside = Beside(runtime)
        runtime.launching = self._queue
        try:
            yield beside
        finally:
            runtime.launching = runtime.queue
            beside.ended(cl.enqueue_marker(self._queue))
            self._queue.flush()

    def finish(self) -> None:
        """Wait for all that was queued."""
        if self._queue is not None:
            self._queue.finish()
