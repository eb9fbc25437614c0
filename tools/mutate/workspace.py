"""A copy of the source tree in which one file is mutated and tests are run.

The tree itself is never changed, and the copy goes with the process: a killed run leaves no more
than a folder in the system's temporary one.
"""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

COPIED = ("ssgi_cl", "kernels", "rasterize", "bench", "tests", "tools", "docs")
ROOT_FILES = ("pyproject.toml", "README.md", "CHANGELOG.md", "Makefile", "LICENSE")
CACHES = ("pocl", "pytools", "pyopencl", "ssgi_cl")
"""Folders of the user's cache that tests profit from; what mutants add goes with the copy."""
MEMORY = 24 << 30
"""Bytes of address space that a test process may have."""
NOTHING_COLLECTED = 5


@dataclass(frozen=True)
class Outcome:
    """Result of a run of tests.

    Attributes:
        code: exit status of pytest; None: it ran past its time.
        seconds: how long it took.
        output: what it wrote.
    """

    code: int | None
    seconds: float
    output: str

    @property
    def failed(self) -> str:
        """The first test that failed, or the empty text."""
        for line in self.output.splitlines():
            if line.startswith(("FAILED ", "ERROR ")):
                return line.split(" ")[1]
        return ""


class Workspace:
    """A copy of a source tree with an import path and driver caches of its own.

    Args:
        root: of the tree.
        caches: whether the user's caches are copied, so that kernels need not be compiled anew.
    """

    def __init__(self, root: Path, *, caches: bool = True) -> None:
        self._stopped = False
        self._process: subprocess.Popen[str] | None = None
        self._folder = tempfile.TemporaryDirectory(prefix="ssgi-mutate-")
        # Scenes and recorded data beside the repository are found beside the copy.
        self.root = Path(self._folder.name) / "tree"
        self.root.mkdir()
        shared = root.resolve().parent / "shared"
        if shared.is_dir():
            (self.root.parent / "shared").symlink_to(shared)
        ignored = shutil.ignore_patterns("__pycache__", "*.egg-info", ".hypothesis")
        for name in COPIED:
            if (root / name).is_dir():
                shutil.copytree(root / name, self.root / name, ignore=ignored)
        for name in ROOT_FILES:
            if (root / name).is_file():
                shutil.copy2(root / name, self.root / name)
        for name in ("kernels", "rasterize", "bench"):  # packages of ssgi_cl, see pyproject.toml
            (self.root / "ssgi_cl" / name).symlink_to(self.root / name)
        cache = Path(self._folder.name) / "cache"
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        for name in CACHES:
            if caches and (home / name).is_dir():
                _copy_cache(home / name, cache / name)
        cache.mkdir(exist_ok=True)
        self._environment = {
            **os.environ,
            "PYTHONPATH": str(self.root),
            "XDG_CACHE_HOME": str(cache),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        self._environment.pop("POCL_CACHE_DIR", None)

    def close(self) -> None:
        """Remove the copy."""
        self._folder.cleanup()

    def stop(self) -> None:
        """End the tests that run, and run no more; may be called from another thread."""
        self._stopped = True
        process = self._process
        if process is not None and process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)

    def write(self, path: str, source: bytes) -> None:
        """Replace a file of the copy."""
        (self.root / path).write_bytes(source)

    def pytest(self, tests: list[str], limit: float) -> Outcome:
        """Run test files until the first failure, or until `limit` seconds have passed."""
        if self._stopped:
            return Outcome(None, 0.0, "")
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-x",
            "-q",
            "-m",
            "not slow",
            "--tb=short",
            "-p",
            "no:cacheprovider",
            "-p",
            "no:randomly",
            *tests,
        ]
        started = time.monotonic()
        self._process = process = subprocess.Popen(
            command,
            cwd=self.root,
            env=self._environment,
            text=True,
            errors="replace",
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=_limited,
        )
        try:
            output, _ = process.communicate(timeout=limit)
            code: int | None = process.returncode
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            output, _ = process.communicate()
            code = None
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            raise
        return Outcome(code, time.monotonic() - started, output)


def _copy_cache(source: Path, target: Path) -> None:
    """Copy what there is; other processes may add and remove files meanwhile."""
    with contextlib.suppress(shutil.Error):
        shutil.copytree(source, target)


def _limited() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
