"""Cache folders where there is no home, or none that can be written."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

import pytest

from ssgi_cl.device.drivers import caches as driver_caches
from ssgi_cl.device.drivers.caches import cache_folder, pocl_folder

NOWHERE = "/proc/nowhere"
"""A folder in which nobody can make a file, whoever runs the tests."""
replaced: Any = driver_caches.replaced_caches.__wrapped__


@pytest.fixture
def homeless(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No HOME and no entry in /etc/passwd, as in containers; the folder for temporary files."""

    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    for name in ("HOME", "XDG_CACHE_HOME", "SSGI_CL_CACHE", "POCL_CACHE_DIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(driver_caches, "_own_temporary", driver_caches._own_temporary.__wrapped__)
    return tmp_path


def test_the_folders_are_those_that_variables_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSGI_CL_CACHE", "/a")
    monkeypatch.setenv("POCL_CACHE_DIR", "/b")
    assert (cache_folder(), pocl_folder()) == (Path("/a"), Path("/b"))
    monkeypatch.delenv("SSGI_CL_CACHE")
    monkeypatch.delenv("POCL_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", "/c")
    assert (cache_folder(), pocl_folder()) == (Path("/c/ssgi_cl"), Path("/c/pocl/kcache"))


def test_without_a_home_a_temporary_folder_of_the_user_serves(homeless: Path) -> None:
    folder = homeless / f"ssgi_cl-{os.getuid()}"
    assert cache_folder() == folder / "ssgi_cl"
    assert pocl_folder() == folder / "pocl" / "kcache"
    assert folder.stat().st_mode & 0o777 == 0o700
    # PyOpenCL and its friends take it too, and make no folder named ~.
    assert replaced() == {"XDG_CACHE_HOME": str(folder)}


def test_without_a_home_the_variable_serves(homeless: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SSGI_CL_CACHE", str(homeless / "given"))
    assert cache_folder() == homeless / "given"
    assert replaced() == {"XDG_CACHE_HOME": str(homeless / "given")}
    assert pocl_folder() == homeless / "given" / "pocl" / "kcache"


@pytest.mark.parametrize("bad", ["others may write", "a link", "a file"])
def test_a_folder_that_is_not_the_users_alone_is_not_used(homeless: Path, bad: str) -> None:
    folder = homeless / f"ssgi_cl-{os.getuid()}"
    if bad == "a link":
        (homeless / "elsewhere").mkdir(mode=0o700)
        folder.symlink_to(homeless / "elsewhere")
    elif bad == "a file":
        folder.touch()
    else:
        folder.mkdir()
        folder.chmod(0o777)
    taken = cache_folder()
    assert folder not in taken.parents
    assert homeless in taken.parents


def test_folders_that_cannot_be_written_are_replaced(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", NOWHERE)
    monkeypatch.delenv("POCL_CACHE_DIR", raising=False)
    monkeypatch.delenv("SSGI_CL_CACHE", raising=False)
    variables = replaced()
    assert variables.keys() == {"PYOPENCL_NO_CACHE", "POCL_CACHE_DIR"}
    assert Path(variables["POCL_CACHE_DIR"]).is_dir()
    monkeypatch.setenv("SSGI_CL_CACHE", str(tmp_path))
    assert replaced()["POCL_CACHE_DIR"] == str(tmp_path / "pocl")
    monkeypatch.setenv("SSGI_CL_CACHE", NOWHERE)
    assert Path(replaced()["POCL_CACHE_DIR"]).is_dir()
