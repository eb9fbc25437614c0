"""One function over many frames: reading, computing and writing overlap, and what is done is not done again."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.io import exr, png
from ssgi_cl.sequences.cluster import on_cluster
from ssgi_cl.sequences.frame_names import FrameNames
from ssgi_cl.sequences.frame_result import FrameFile, FrameResult, FrameResults, FrameRows, reason
from ssgi_cl.sequences.keys import NAME, described, key_of, stored_key

AHEAD = 2
"""Frames that are read before they are needed, and results that wait to be written: more would only take memory."""
SUFFIXES = (".exr", ".png")

_THERE = object()
"""What a frame is read as whose file is there already."""

Progress = Callable[[int, int, float], object]


@checked_keywords
def map_frames(
    function: Callable[..., Any],
    inputs: Iterable[Any],
    outputs: str | os.PathLike[str] | Iterable[str | os.PathLike[str]] | None = None,
    *,
    arguments: Mapping[str, Any] | None = None,
    client: Any = None,
    again: bool = False,
    retries: int = 2,
    resources: Mapping[str, float] | None = None,
    progress: Progress | None = None,
    finished: Callable[[FrameResult], object] | None = None,
) -> FrameResults:
    """Call a function with each of many frames, and keep the results in files.

    A frame that fails does not stop the others; see `FrameResults.check`. Each file is whole or absent. A run that
    was killed does only what is missing when it is started again: a file whose key is that of its input's content,
    of the function with its arguments, and of this library's version, is skipped.

    Args:
        function: called as function(input, **arguments), in order. Returns an array, arrays by name, or a
            `FrameFile`, for its file: see `ssgi_cl.io.exr.write`; for .png an image of uint8 or uint16. If it has a
            method `read`, that is called with an input ahead of time, in another thread, and the function with what
            it returned.
        inputs: paths, or anything else; of paths the content of the files counts.
        outputs: files of the results, .exr or .png, as many as inputs, or a name with #### for their numbers, from
            1 on. Without, results are returned, and nothing is skipped.
        arguments: of the function, by name.
        client: of Dask distributed: frames are computed by its workers, which must reach the files by the
            same paths, and have this version of the library. Without, by this process.
        again: whether to compute frames whose file is there, too.
        retries: how often a frame is tried again on a cluster that gave it up, which Dask does after the fourth
            death of a worker that had it.
        resources: what a frame takes of those of a worker of a cluster, by name; by default one "GPU" where all
            workers have it.
        progress: called with frames that are finished, all frames, and the seconds that are left by estimate.
        finished: called with each result.

    Returns:
        A result for each input, in order.

    Raises:
        ValueError: as many outputs as inputs are not given, two are the same file, or one is of an unknown kind.
        SequenceError: the cluster is not of this version, or was lost; finished files stay.
    """
    given = list(inputs)
    files = _files(outputs, len(given))
    arguments = dict(arguments or {})
    work = Work(function, arguments, described(function, arguments), again)
    report = _Report(len(given), progress, finished)
    if client is not None:
        once = partial(_one, work)
        return FrameResults(on_cluster(client, once, given, files, retries, report, resources))
    return FrameResults(_serial(work, given, files, report))


@dataclass(frozen=True)
class Work:
    """What is done to every frame.

    Attributes:
        function, arguments, again: as of `map_frames`.
        key: hash of function and arguments.
    """

    function: Callable[..., Any]
    arguments: Mapping[str, Any]
    key: str
    again: bool


def _files(outputs: str | os.PathLike[str] | Iterable[str | os.PathLike[str]] | None, count: int) -> list[Path | None]:
    """Return the file of each result."""
    if outputs is None:
        return [None] * count
    if isinstance(outputs, (str, os.PathLike)):
        names = FrameNames.of(outputs)
        if names is None and count != 1:
            raise ValueError(f"outputs is {os.fspath(outputs)!r}: expected #### in the name of {count} files")
        paths = [Path(outputs)] if names is None else [names.path(number) for number in range(1, count + 1)]
    else:
        paths = [Path(path) for path in outputs]
    if len(paths) != count:
        raise ValueError(f"outputs has {len(paths)} files: expected {count}, one for each input")
    if len(set(paths)) != count:
        twice = next(path for path in paths if paths.count(path) > 1)
        raise ValueError(f"outputs has {os.fspath(twice)!r} twice: expected a file for each input")
    for path in paths:
        if path.suffix.lower() not in SUFFIXES:
            raise ValueError(f"outputs has {os.fspath(path)!r}: expected names that end in {' or '.join(SUFFIXES)}")
    return list(paths)


class _Report:
    """Calls `progress` and `finished` as frames finish; skipped ones tell nothing of the time that others take."""

    def __init__(self, total: int, progress: Progress | None, finished: Callable[[FrameResult], object] | None) -> None:
        self._total, self._progress, self._told = total, progress, finished
        self._finished = self._computed = 0
        self._start = time.perf_counter()

    def __call__(self, result: FrameResult) -> None:
        self._finished += 1
        self._computed += result.state != "skipped"
        if self._told is not None:
            self._told(result)
        if self._progress is not None:
            each = (time.perf_counter() - self._start) / max(self._computed, 1)
            self._progress(self._finished, self._total, each * (self._total - self._finished))


def _serial(work: Work, inputs: Sequence[Any], files: Sequence[Path | None], report: _Report) -> Iterator[FrameResult]:
    """Yield results: inputs are read ahead by one thread, and files are written by another."""
    read = getattr(work.function, "read", None)

    def prepared(source: Any, file: Path | None) -> tuple[str, Any]:
        key = "" if file is None else key_of(work.key, source)
        if file is not None and not work.again and stored_key(file) == key:
            return key, _THERE
        return key, read(source) if read is not None else source

    waiting: deque[Future[FrameResult]] = deque()
    with ThreadPoolExecutor(1) as reader, ThreadPoolExecutor(1) as writer:
        jobs = iter(zip(inputs, files, strict=True))
        ahead: deque[tuple[Any, Path | None, Future[tuple[str, Any]]]] = deque()

        def fill() -> None:
            while len(ahead) < AHEAD and (job := next(jobs, None)) is not None:
                ahead.append((*job, reader.submit(prepared, *job)))

        fill()
        while ahead:
            source, file, future = ahead.popleft()
            fill()
            waiting.append(writer.submit(_finish, *_computed(work, source, file, future)))
            while len(waiting) > AHEAD or (waiting and (waiting[0].done() or not ahead)):
                result = waiting.popleft().result()
                report(result)
                yield result


def _computed(work: Work, source: Any, file: Path | None, future: Future[tuple[str, Any]]) -> tuple[FrameResult, str]:
    """Return the result of a frame before its file is written, and its key."""
    start = time.perf_counter()
    try:
        key, data = future.result()
        if data is _THERE:
            return FrameResult(source, file, "skipped"), key
        value = work.function(data, **work.arguments)
    except Exception as error:
        return FrameResult(source, file, "failed", reason=reason(error), seconds=time.perf_counter() - start), ""
    return FrameResult(source, file, "done", value=value, seconds=time.perf_counter() - start), key


def _finish(result: FrameResult, key: str) -> FrameResult:
    """Write the file of a result."""
    if result.state != "done" or result.output is None:
        return result
    start = time.perf_counter()
    try:
        write_result(result.output, result.value, key)
    except Exception as error:
        return FrameResult(result.input, result.output, "failed", reason=reason(error), seconds=result.seconds)
    seconds = result.seconds + time.perf_counter() - start
    return FrameResult(result.input, result.output, "done", seconds=seconds)


def _one(work: Work, source: Any, file: Path | None) -> FrameResult:
    """Return the result of one frame, its file written: what a worker does."""
    (result,) = _serial(work, [source], [file], _Report(1, None, None))
    return result


def write_result(path: Path, value: Any, key: str) -> None:
    """Write what a function returned, with its key; whole or not at all.

    Raises:
        TypeError, ValueError: it is not what the file can hold.
        OSError: the file can't be written.
    """
    if path.suffix.lower() == ".png":
        png.write(path, value, texts={NAME: key})
        return
    if isinstance(value, FrameRows):
        exr.write_in_rows(path, value.rows, like=value.like, attributes={NAME: key})
        return
    file = value if isinstance(value, FrameFile) else FrameFile(value if isinstance(value, Mapping) else {"": value})
    arrays = {name: np.asarray(array) for name, array in file.arrays.items()}
    options: dict[str, Any] = {"like": file.like, "camera": file.camera, "half": file.half, "parts": file.parts}
    exr.write(path, arrays, attributes={NAME: key}, **options)
