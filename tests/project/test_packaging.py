"""Packaging: every package is listed, and what is built holds what an installation needs."""

from __future__ import annotations

import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import pytest

from ssgi_cl.device import sources

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    with (ROOT / "pyproject.toml").open("rb") as file:
        return tomllib.load(file)


EXPERIMENTS = ("ssgi_cl.bench.experiments", "ssgi_cl.bench.experiments.shots")
"""Run from a clone alone."""


def folders_of(tool: dict[str, Any]) -> dict[str, Path]:
    """Package name -> folder, for every folder in the repository that holds a package."""
    roots = {"ssgi_cl": ROOT / "ssgi_cl"}
    roots |= {name: ROOT / folder for name, folder in tool["package-dir"].items()}
    found = {}
    for name, root in roots.items():
        for init in root.rglob("__init__.py"):
            inner = init.parent.relative_to(root).parts
            found[".".join([name, *inner])] = init.parent
    return found


def test_every_package_folder_is_listed(project: dict[str, Any]) -> None:
    tool = project["tool"]["setuptools"]
    assert sorted([*tool["packages"], *EXPERIMENTS]) == sorted(folders_of(tool))


def test_every_folder_of_python_files_is_a_package(project: dict[str, Any]) -> None:
    tool = project["tool"]["setuptools"]
    packages = set(folders_of(tool).values())
    for root in ("ssgi_cl", "rasterize", "bench", "kernels"):
        for file in (ROOT / root).rglob("*.py"):
            assert file.parent in packages, f"{file} is in no package"


@pytest.mark.slow
def test_wheel_and_sdist_hold_the_kernels_and_no_other_import_name(project: dict[str, Any], tmp_path: Path) -> None:
    pytest.importorskip("build")
    pytest.importorskip("setuptools", minversion="77")
    source = tmp_path / "source"
    # A copy of what git tracks or would track: a build leaves folders in the source.
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.split("\0")
    for name in listed:
        if name and (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    done = subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(tmp_path), str(source)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    (sdist,) = tmp_path.glob("*.tar.gz")

    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    tops = {name.split("/")[0] for name in names}
    # The program's start is a module of its own, named like the package so that nothing clashes.
    own = {"ssgi_cl"}
    assert {top for top in tops if not top.endswith(".dist-info")} == own
    kernels = {f"ssgi_cl/kernels/{path}" for path in sources.kernel_names()}
    kernels |= {
        f"ssgi_cl/kernels/{file.relative_to(ROOT / 'kernels').as_posix()}" for file in (ROOT / "kernels").rglob("*.clh")
    }
    assert kernels <= names
    assert "ssgi_cl/py.typed" in names
    for package, folder in folders_of(project["tool"]["setuptools"]).items():
        inside = package.replace(".", "/")
        modules = {f"{inside}/{file.name}" for file in folder.glob("*.py")}
        assert not modules & names if package in EXPERIMENTS else modules <= names

    with tarfile.open(sdist) as archive:
        members = {name.split("/", 1)[1] for name in archive.getnames() if "/" in name}
    for part in ("kernels", "ssgi_cl", "rasterize", "bench"):
        for path in (source / part).rglob("*"):
            if path.suffix in (".py", ".cl", ".clh") and "experiments" not in path.parts:
                assert path.relative_to(source).as_posix() in members
    assert {"README.md", "LICENSE", "pyproject.toml"} <= members
