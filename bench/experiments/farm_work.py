"""What workers do in `ssgi_cl.bench.experiments.farm`: a module of its own, which their processes import."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ssgi_cl.sequences.apply_exr import ApplyExr
from ssgi_cl.sequences.exr_passes import Passes

SECONDS, TRACE, OUTPUTS = "SSGI_CL_FARM_SECONDS", "SSGI_CL_FARM_TRACE", "SSGI_CL_FARM_OUTPUTS"
"""Variables: seconds that a frame takes longer than it does, so that kills hit it; a file that gets a line for each
frame that is begun, "NAME PROCESS there" or "NAME PROCESS new", as its result was there or not; the folder of the
results. They are no fields of `Traced`, for those belong to the keys of results, which would differ from those of one
process."""
_WORK = ApplyExr(technique="gtao", parameters={"radius": 0.4}, passes=Passes(nan="hole"))


@dataclass(frozen=True)
class Traced:
    """Applies `gtao` to a file, and writes down that it began."""

    def read(self, source: Path) -> Any:
        """Return what the file holds."""
        if TRACE in os.environ:
            there = (Path(os.environ[OUTPUTS]) / source.name).exists()
            file = os.open(os.environ[TRACE], os.O_APPEND | os.O_CREAT | os.O_WRONLY)
            try:
                os.write(
                    file, f"{source.name} {os.getpid()} {'there' if there else 'new'}\n".encode()
                )  # whole, amid no other
            finally:
                os.close(file)
        return _WORK.read(source)

    def __call__(self, frame: Any) -> Any:
        """Return the result."""
        time.sleep(float(os.environ.get(SECONDS, 0.0)))
        return _WORK(frame)


def nothing(number: int) -> Any:
    """Do nothing."""
    return number
