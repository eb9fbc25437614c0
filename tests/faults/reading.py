"""Read files that nobody vouches for, in a process of little memory that may die.

Run as a script: the path of a file a line on standard input, a verdict (JSON) a line on standard
output. The tests replay kept files through it, the fuzzer mutated ones.
"""

from __future__ import annotations

import json
import os
import re
import resource
import select
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any

from ssgi_cl.core.errors import SsgiError
from ssgi_cl.io import exr
from ssgi_cl.rasterize.files.load import READERS, load_scene

SECONDS = {"refused": 1.0, "loaded": 10.0}
"""Processor time that a file of a few kilobytes may take; a sound one can hold a large texture."""

MEBIBYTES = {"refused": 300.0, "loaded": 1200.0}
"""Memory that a file of a few kilobytes may take, likewise."""

PATIENCE = 300.0
"""Seconds by the clock after which a reader counts as hanging, also on a busy machine."""

MOST_SECONDS = 20.0
"""Processor time after which a reader ends itself."""

ADDRESS_SPACE = 2 << 30
"""Bytes that may be mapped beyond what the modules take; what goes further fails at once."""


class Reader:
    """The process that reads, started anew when it dies."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def verdict(self, path: Path) -> dict[str, Any]:
        """Return what reading `path` came to."""
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
            )
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(f"{path}\n".encode())
        process.stdin.flush()
        # The first answer waits for the modules to be imported.
        ready, _, _ = select.select([process.stdout], [], [], PATIENCE)
        line = process.stdout.readline() if ready else b""
        if line:
            answer: dict[str, Any] = json.loads(line)
            return answer
        code = self.close()
        outcome = "crash" if ready else "hang"
        return {"outcome": outcome, "detail": f"exit status {code}", "place": "", "seconds": 0.0}

    def close(self) -> int | None:
        """End the process and return its exit status."""
        if self._process is None:
            return None
        with self._process as process:  # closes the pipes
            process.kill()
        self._process = None
        return process.returncode


def verdict(path: Path) -> dict[str, Any]:
    """Return what reading a file came to: "loaded", "refused", or a fault in one word."""
    _forget_peak()
    signal.setitimer(signal.ITIMER_PROF, MOST_SECONDS)
    before, start = _memory("VmRSS"), time.process_time()
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        outcome, detail, place = _outcome(path)
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    seconds, mebibytes = time.process_time() - start, _memory("VmHWM") - before
    if outcome in ("loaded", "refused"):
        if warned:
            outcome, detail = "warning", str(warned[0].message)
            place = f"{warned[0].filename}:{warned[0].lineno}"
        elif seconds > SECONDS[outcome] + 20e-6 * path.stat().st_size:
            outcome, detail = "slow", f"{detail} ({seconds:.1f} s)"
        elif mebibytes > MEBIBYTES[outcome]:
            outcome, detail = "large", f"{detail} ({mebibytes:.0f} MiB)"
    return {
        "outcome": outcome,
        "detail": detail[:1000],
        "place": place,
        "seconds": round(seconds, 3),
        "mebibytes": round(mebibytes, 1),
    }


def _outcome(path: Path) -> tuple[str, str, str]:
    try:
        if path.suffix in READERS:
            load_scene(path)
        else:
            exr.read_gbuffer(path)
    except (SsgiError, ValueError, OSError) as error:
        text = str(error)
        if path.name not in text:
            return "nameless", text, _place(error)
        if len(text) > 600:
            return "wordy", text[:300], _place(error)
        if re.search(r"can't be read: \w+:", text):  # some part of a parser tripped
            return "unclear", text, _place(error.__cause__ or error)
        return "refused", text, _place(error)
    except BaseException as error:
        return "unexpected", f"{type(error).__name__}: {error}", _place(error)
    return "loaded", "", ""


def _place(error: BaseException) -> str:
    """Return the file and line that raised."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    if trace is None:
        return ""
    return f"{Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}"


def _memory(name: str) -> float:
    """Return a figure of /proc/self/status in MiB."""
    status = Path("/proc/self/status").read_text()
    found = re.search(rf"{name}:\s*(\d+) kB", status)
    return float(found[1]) / 1024 if found else 0.0


def _forget_peak() -> None:
    Path("/proc/self/clear_refs").write_text("5")


def main() -> None:
    """Answer for every path on standard input."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # OpenEXR prints to standard output
    # A file that needs longer is a fault anyway; the wall clock is the parent's.
    limit = int(_memory("VmSize") * 2**20) + ADDRESS_SPACE
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    for line in sys.stdin:
        answers.write(json.dumps(verdict(Path(line.rstrip("\n")))) + "\n")


if __name__ == "__main__":
    main()
