"""The gallery: each script runs as it stands, makes a picture, is short and says what to notice."""

from __future__ import annotations

import ast
import os
import runpy
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs/gallery"
SCRIPTS = sorted(FOLDER.rglob("*.py"))
LONG = {"benchmark_of_an_own_scene", "mirrors_and_glass", "soft_shadows"}
"""Ten seconds and more, most of it for references or a process of its own."""
LINES = {"own_technique": 60}
"""Most lines of code where it is not 40."""


def code_lines(text: str) -> int:
    """Return the number of lines that are neither blank nor comments, imports or the header."""
    tree = ast.parse(text)
    skipped: set[int] = set()
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom) or node is tree.body[0]:
            skipped |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines = enumerate(text.splitlines(), 1)
    return sum(bool(line.strip()) and line.strip()[0] != "#" and number not in skipped for number, line in lines)


def test_there_are_sixteen_scripts_and_more() -> None:
    assert len(SCRIPTS) >= 16
    assert {path.stem for path in SCRIPTS} >= LONG | set(LINES)
    for folder in {path.parent for path in SCRIPTS}:
        assert (folder / "README.rst").is_file(), f"{folder} has no heading"


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_is_short_and_says_what_to_notice(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    header = ast.get_docstring(ast.parse(text)) or ""
    title, line = header.splitlines()[:2]
    assert line == "=" * len(title)
    assert "**What to notice.**" in header
    assert code_lines(text) <= LINES.get(path.stem, 40)


def picture(path: Path, folder: Path) -> None:
    """Run a script and look at its figures: each has panels that are not of one colour."""
    matplotlib = pytest.importorskip("matplotlib")
    for module in ("mitsuba", "embreex"):
        pytest.importorskip(module)
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plt.close("all")
    with warnings.catch_warnings():
        warnings.simplefilter("default")  # of matplotlib's fonts and other libraries
        runpy.run_path(str(path), run_name="__main__")
    assert plt.get_fignums()
    for number in plt.get_fignums():
        figure = plt.figure(number)
        for axes in figure.axes:
            for image in axes.get_images():
                assert np.ptp(np.asarray(image.get_array(), float)) > 0.05, axes.get_title()
        figure.savefig(folder / f"{number}.png")
        assert (folder / f"{number}.png").stat().st_size > 10_000
    plt.close("all")


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=pytest.mark.slow if path.stem in LONG else ()) for path in SCRIPTS],
    ids=lambda path: path.stem,
)
def test_a_script_runs_and_makes_a_picture(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    picture(path, tmp_path)
    assert {entry.suffix for entry in tmp_path.iterdir()} == {".png"}, "it left files"


def test_what_the_header_says_of_the_pit_is_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    monkeypatch.chdir(tmp_path)
    found = runpy.run_path(str(FOLDER / "arrays/sky_view_factor.py"))
    # The form factor of a point to a parallel square of 2 a, a = 120, at the distance 40 (ratio 3), four quarters.
    x = 3.0 / np.sqrt(10.0)
    expected = 4.0 / (2.0 * np.pi) * 2.0 * x * np.arctan(x)
    assert expected == pytest.approx(0.917, abs=5e-4)
    assert found["sky_view"][129, 224] == pytest.approx(expected, abs=0.01)  # 8 slices of 32 taps


def test_a_script_with_no_picture_fails(tmp_path: Path) -> None:
    (tmp_path / "none.py").write_text("print(1)\n")
    with pytest.raises(AssertionError):
        picture(tmp_path / "none.py", tmp_path)


@pytest.mark.slow
def test_scripts_need_nothing_of_the_checkout(tmp_path: Path) -> None:
    path = FOLDER / "errors/layers_and_overscan.py"
    environment = {**os.environ, "MPLBACKEND": "Agg"}
    subprocess.run([sys.executable, str(path)], cwd=tmp_path, env=environment, check=True, timeout=300)
