"""The results of a benchmark as a JSON document: stamped, written, read and taken apart."""

from __future__ import annotations

import json
import math
import os
import platform
import subprocess
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

import ssgi_cl.version
from ssgi_cl.core import atomic
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.truth.ray_ao import threads

FORMAT = "ssgi-bench 2"

PACKAGES = (
    "numpy",
    "pyopencl",
    "pocl-binary-distribution",
    "embreex",
    "mitsuba",
    "flip-evaluator",
    "vtk",
    "pyoidn",
    "pyrender",
)
"""Distributions on which a time or an error may depend."""

_SPREAD: dict[str, Any] = {"median": float, "low": float, "high": float}
_RESULT: dict[str, Any] = {
    "name": str,
    "family": str,
    "setting": str,
    "scene": str,
    "size": list,
    "quantity": str,
    "wall_ms": _SPREAD,
    "ratio": _SPREAD,
    "unsteady": str,
    "errors": dict,
    "passes": list,
}
_DOCUMENT: dict[str, Any] = {
    "created": str,
    "options": dict,
    "versions": dict,
    "device": {"label": str, "variant": str},
    "machine": {"cpu": str, "threads": int, "system": str},
    "calibration": {"bandwidth_gb_s": float, "gathers_g_s": float, "multiply_adds_gflop_s": float},
    "reference": {"name": str, "ms": float},
    "results": list,
    "skipped": list,
}
"""Fields that must be there, and what they hold."""
_NAMES = {str: "text", list: "a list", dict: "an object", int: "an integer"}


def stamp(runtime: Runtime) -> dict[str, Any]:
    """Return the part of a document that says what was measured, when and on what."""
    revision, modified = _revision(Path(ssgi_cl.version.__file__))
    versions: dict[str, str | None] = {"ssgi_cl": ssgi_cl.version.__version__, "python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = None
    return {
        "format": FORMAT,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": versions,
        "revision": revision,
        "modified": modified,
        "device": {
            "label": runtime.info.label,
            "kind": runtime.info.kind,
            "units": runtime.info.units,
            "variant": str(runtime.variant),
        },
        "machine": {
            "cpu": _cpu(),
            "threads": threads(),
            "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        },
    }


def text(document: Mapping[str, Any]) -> str:
    """Return a document as JSON; numbers that are not finite become null."""
    return json.dumps(plain(document), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def write(path: str | os.PathLike[str], document: Mapping[str, Any]) -> None:
    """Write a document, whole or not at all.

    Raises:
        OSError: the file can't be written; the message names it.
    """
    with atomic.replacement(path) as temporary:
        temporary.write_text(text(document), encoding="utf-8")


def read(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Return the document in a file.

    Raises:
        ValueError: the file is not JSON, of another format, or lacks something; the message says
            what and where.
        OSError: the file can't be read.
    """
    try:
        document = json.loads(Path(path).read_text(encoding="utf-8"), parse_constant=_refuse_constant)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{os.fspath(path)} is not JSON: {error}") from error
    try:
        _check(document)
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)} is no benchmark that can be read: {error}") from error
    return dict(document)


def clock(result: Mapping[str, Any]) -> Mapping[str, float]:
    """Return the spread of a result's wall time in ms: the figure that is compared."""
    spread: Mapping[str, float] = result["wall_ms"]
    return spread


def timed(result: Mapping[str, Any]) -> bool:
    """Return whether a result's time says anything; a bound's does not."""
    return bool(result.get("timed", True))


def metric(result: Mapping[str, Any], truth: str, name: str) -> float | None:
    """Return a number of a result's error; None where it was not measured or is not finite.

    Args:
        truth: "world" or "assumption".
        name: of a metric, such as "rmse".
    """
    value = ((result.get("errors") or {}).get(truth) or {}).get(name)
    return value if value is not None and math.isfinite(value) else None


Group = tuple[str, str, tuple[int, int]]
"""Quantity, scene and (rows, columns): what results must share to be held to each other."""


def groups(results: list[dict[str, Any]]) -> dict[Group, list[dict[str, Any]]]:
    """Return the results of each group, the fastest first."""
    found: dict[Group, list[dict[str, Any]]] = {}
    for result in results:
        rows, columns = result["size"]
        key = (result["quantity"], result["scene"], (rows, columns))
        found.setdefault(key, []).append(result)
    return {key: sorted(some, key=lambda r: clock(r)["median"]) for key, some in found.items()}


def plain(value: Any) -> Any:
    """Return what JSON can hold."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _refuse_constant(name: str) -> None:
    raise ValueError(f"it holds {name}: expected finite numbers and null")


def _check(document: object) -> None:
    if not isinstance(document, dict) or "format" not in document:
        raise ValueError(f"it has no format: expected {FORMAT!r}")
    if document["format"] != FORMAT:
        raise ValueError(f"its format is {document['format']!r}: expected {FORMAT!r}")
    _check_fields("", document, _DOCUMENT)
    names = set()
    for index, result in enumerate(document["results"]):
        where = f"results[{index}]"
        _check_fields(where, result, _RESULT)
        if result.get("device_ms") is not None:
            _check_fields(f"{where}.device_ms", result["device_ms"], _SPREAD)
        size = result["size"]
        if len(size) != 2 or not all(type(side) is int and side > 0 for side in size):
            raise ValueError(f"{where}.size is {size}: expected rows and columns, each >= 1")
        if result["name"] in names:
            raise ValueError(f"{where}.name is {result['name']!r}: expected each case once")
        names.add(result["name"])
    for index, entry in enumerate(document["skipped"]):
        _check_fields(f"skipped[{index}]", entry, {"name": str, "reason": str})


def _check_fields(where: str, value: object, fields: Mapping[str, Any]) -> None:
    if not isinstance(value, dict):
        raise ValueError(f"{where} is {value!r:.60}: expected an object")
    for name, kind in fields.items():
        path = f"{where}.{name}".lstrip(".")
        if name not in value:
            raise ValueError(f"{path} is missing")
        item = value[name]
        if isinstance(kind, Mapping):
            _check_fields(path, item, kind)
        elif kind is float:
            if isinstance(item, bool) or not isinstance(item, (int, float)) or item < 0:
                raise ValueError(f"{path} is {item!r:.60}: expected a number >= 0")
        elif not isinstance(item, kind) or isinstance(item, bool):
            raise ValueError(f"{path} is {item!r:.60}: expected {_NAMES[kind]}")


def _revision(file: Path) -> tuple[str | None, bool | None]:
    """Return git's short name of what is checked out, and whether files differ from it.

    None for both unless git knows the file: a package installed inside another project's folder
    is not of that project's revision.
    """

    def git(*arguments: str) -> str:
        return subprocess.run(
            ["git", "--no-optional-locks", "-C", str(file.parent), *arguments],
            capture_output=True,
            text=True,
            check=True,
            timeout=10.0,
        ).stdout.strip()

    try:
        git("ls-files", "--error-unmatch", file.name)
        revision = git("rev-parse", "--short", "HEAD")
        return revision, bool(git("status", "--porcelain", "--untracked-files=no"))
    except (OSError, ValueError, subprocess.SubprocessError):
        return None, None


def _cpu() -> str:
    """Return the processor's name, or its architecture where the system tells no more."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except (OSError, ValueError):
        pass  # not Linux
    return platform.processor() or platform.machine()
