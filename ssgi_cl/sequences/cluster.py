"""Frames on the workers of Dask distributed: only paths and arguments travel, results are files."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from functools import partial
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

from ssgi_cl.core.errors import MissingExtraError, SequenceError
from ssgi_cl.sequences.frame_result import FrameResult, reason
from ssgi_cl.version import __version__

RESOURCE = "GPU"
"""Resource of workers, of which a frame takes one where all workers have it: a GPU gets one frame at a time."""
ANSWER, WORKERS = 10.0, 30.0
"""Seconds that a scheduler has to answer, and a cluster to have a first worker."""
_LIMITS = ("POCL_MAX_PTHREAD_COUNT", "POCL_CPU_MAX_CU_COUNT")


def on_cluster(
    client: Any,
    work: Callable[..., FrameResult],
    inputs: Sequence[Any],
    files: Sequence[Path | None],
    retries: int,
    report: Callable[[FrameResult], None],
    resources: Mapping[str, float] | None = None,
) -> Iterator[FrameResult]:
    """Yield results in the order of the inputs; `work` is called with each and its file, all else as of `map_frames`.

    Raises:
        MissingExtraError: Dask distributed is not installed.
        SequenceError: workers have another version of the library, there are none, or the scheduler was lost.
    """
    distributed = _distributed()
    resources = _checked_workers(client, resources)
    done: dict[int, FrameResult] = {}
    try:
        # All at once, which costs the scheduler and this process a fraction of as many calls of `submit`.
        once = partial(_on_worker, __version__, work)
        submitted = client.map(once, inputs, files, pure=False, retries=retries, resources=resources)
        futures = {future: number for number, future in enumerate(submitted)}
        lost = [0] * len(inputs)
        completed = distributed.as_completed(list(futures))
        for future in completed:
            number = futures.pop(future)
            try:
                result = future.result()
            except distributed.CancelledError:  # by nobody here: with the scheduler all it knew is gone
                break
            except distributed.KilledWorker as error:
                # Dask counts the deaths of a worker for all frames that wait for it, and gives up all of them.
                lost[number] += 1
                if lost[number] <= retries:
                    (anew,) = client.map(
                        once, [inputs[number]], [files[number]], pure=False, retries=retries, resources=resources
                    )
                    futures[anew] = number
                    completed.add(anew)
                    continue
                result = FrameResult(inputs[number], files[number], "failed", reason=reason(error))
            except Exception as error:
                result = FrameResult(inputs[number], files[number], "failed", reason=reason(error))
            done[number] = result
            report(result)
    except (OSError, TimeoutError):
        pass
    if len(done) < len(inputs):
        raise SequenceError(
            f"the scheduler was lost after {len(done)} of {len(inputs)} frames; the same call does the rest"
        )
    yield from (done[number] for number in range(len(inputs)))


def connected(address: str) -> Any:
    """Return a client of the scheduler at an address, for a command: what Dask logs besides is not shown.

    Raises:
        MissingExtraError: Dask distributed is not installed.
        SequenceError: the scheduler does not answer.
    """
    client_of, made = _distributed().Client, Future[Any]()
    for name in ("distributed", "distributed.client"):  # which write tracebacks of what is told in a line
        logging.getLogger(name).setLevel(logging.CRITICAL)

    def connect() -> None:
        try:
            made.set_result(client_of(address, timeout=ANSWER))
        except Exception as error:
            made.set_exception(error)

    # In a thread of its own: Dask's limit does not hold for what takes the connection and says nothing.
    Thread(target=connect, daemon=True).start()
    try:
        return made.result(timeout=1.5 * ANSWER)
    except (OSError, ValueError, TypeError) as error:
        why = str(error) or f"it said nothing for {1.5 * ANSWER:g} s"
        raise SequenceError(f"the scheduler at {address} does not answer: {why}") from error


def _distributed() -> Any:
    try:
        return import_module("distributed")
    except ImportError as error:
        raise MissingExtraError(
            "frames on several machines need Dask distributed, which is not installed: pip install 'ssgi-cl[cluster]'"
        ) from error


def _checked_workers(client: Any, wanted: Mapping[str, float] | None = None) -> Mapping[str, float] | None:
    """Return the resources that a frame takes. SequenceError: no worker has them, or one is of another version."""
    try:
        client.wait_for_workers(1, timeout=WORKERS)
        versions = client.run(_version)
    except (OSError, TimeoutError) as error:
        raise SequenceError(f"the scheduler does not answer, or has no worker after {WORKERS:g} s: {error}") from error
    wrong = {address: version for address, version in versions.items() if version != __version__}
    if wrong:
        listed = ", ".join(f"{address} has {version}" for address, version in sorted(wrong.items())[:5])
        raise SequenceError(f"workers have another version of ssgi_cl than {__version__}: {listed}; install the same")
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    has = [each.get("resources") or {} for each in workers]
    if wanted is not None:
        if not any(all(each.get(name, 0.0) >= amount for name, amount in wanted.items()) for each in has):
            listed = " ".join(f"{name}={amount:g}" for name, amount in wanted.items())
            raise SequenceError(
                f"no worker has the resources that a task takes: start some with --resources '{listed}'"
            )
        return wanted
    return {RESOURCE: 1.0} if all(RESOURCE in each for each in has) else None


def _version() -> str:
    return __version__


def _on_worker(version: str, work: Callable[..., FrameResult], *arguments: Any) -> FrameResult:
    """Do a frame in a worker's process, on its share of the processor.

    Raises:
        SequenceError: this worker, which may have come later than the others, has another version of the library.
    """
    if version != __version__:
        raise SequenceError(f"a worker has version {__version__} of ssgi_cl, and not {version}: install the same")
    threads = str(_distributed().get_worker().state.nthreads)
    for name in _LIMITS:  # read when PoCL is loaded, which the first frame does
        os.environ.setdefault(name, threads)
    return work(*arguments)
