"""The mutation tool: what it changes and what it leaves, which tests it runs, and its verdicts."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import pytest

from tools.mutate import kernel_source, python_source
from tools.mutate.campaign import Campaign
from tools.mutate.covering import Covering
from tools.mutate.draw import drawn, edits
from tools.mutate.edits import Edit, Mutant
from tools.mutate.results import EQUIVALENT, KILLED, SURVIVED, Result, as_markdown, score
from tools.mutate.table import Table
from tools.mutate.workspace import Workspace

ROOT = Path(__file__).parents[2]
TABLE = ROOT / "tools" / "mutate" / "table.toml"

PYTHON = b'''"""A docstring < 3."""

@cache(maxsize=2)
def nearest(a: Literal[1], b, unit="px"):
    """Return min(a, b) + 1."""
    if a < b and not b:
        raise ValueError(f"a is {a + 1}: expected 2")
    return max(a, -b) + atan2(a, b) * 0.5
'''
KERNEL = b"""// a < b in a comment
#include "common/lanes.clh"
#if SSGI_LANES > 4
#define LEAST 0.25f // of b - c
#endif
__kernel void k(__global float *restrict out, const int2 size)
{
    const float a = v_min(size.x, size.y) * -LEAST; /* 3 + 4 */
    if (a <= 1.0f) {
        out[0] = f(a, b);
    }
}
"""


@pytest.fixture(scope="module")
def graph() -> Covering:
    return Covering(ROOT)


def changes(found: list[Edit], source: bytes) -> set[tuple[str, str]]:
    return {(edit.old(source), edit.new) for edit in found}


def test_python_is_changed_in_expressions_and_not_in_words() -> None:
    found = changes(python_source.edits(PYTHON), PYTHON)
    assert found == {
        ("a < b and not b", "not (a < b and not b)"),
        ("<", "<="),
        ("<", ">"),
        ("and", "or"),
        ("not b", "b"),
        ("max", "min"),
        ("-b", "b"),
        ("+", "-"),
        ("*", "/"),
        ("a, b", "b, a"),
        ("0.5", "0.625"),
    }


def test_kernels_are_changed_in_code_and_values_of_macros_alone() -> None:
    found = changes(kernel_source.edits(KERNEL), KERNEL)
    assert found == {
        ("0.25f", "0.3125f"),
        ("v_min", "v_max"),
        ("x", "y"),
        ("y", "x"),
        (" * ", " / "),
        ("-", ""),
        (" <= ", " < "),
        (" <= ", " >= "),
        ("1.0f", "1.25f"),
        ("0", "1"),
        ("a <= 1.0f", "!(a <= 1.0f)"),
        ("a, b", "b, a"),
        ("out[0] = f(a, b);", ";"),
    }


def test_what_compiles_to_the_same_bytecode_is_no_mutant() -> None:
    source = b"x = 2 * 3\n"
    same, other = Edit("constant", 4, 9, "6"), Edit("constant", 4, 9, "7")
    assert not python_source.is_new(same, source)
    assert python_source.is_new(other, source)
    assert not python_source.is_new(Edit("constant", 4, 9, "("), source)


def test_the_choice_is_that_of_the_seed_and_none_comes_twice() -> None:
    paths = ["ssgi_cl/io/png.py", "kernels/filters/tonemap.cl"]
    first, again, other = (list(islice(drawn(ROOT, paths, s), 30)) for s in (1, 1, 2))
    assert first == again != other
    every = list(drawn(ROOT, paths, 1))
    assert len(set(every)) == len(every)
    sources = {path: (ROOT / path).read_bytes() for path in paths}
    wanted = {
        (path, edit)
        for path, source in sources.items()
        for edit in edits(path, source)
        if not path.endswith(".py") or python_source.is_new(edit, source)
    }
    assert {(mutant.path, mutant.edit) for mutant in every} == wanted


@pytest.mark.parametrize(
    ("path", "test"),
    [
        ("kernels/ssao/ssao.cl", "tests/techniques/ao/test_ssao.py"),
        ("kernels/vpl/lobe.clh", "tests/techniques/vpl/test_vpl_glossy.py"),
        ("kernels/raster/edges.clh", "tests/rasterize/test_rasterize.py"),
        ("ssgi_cl/core/camera.py", "tests/core/test_camera.py"),
        ("ssgi_cl/techniques/direct/light_data.py", "tests/techniques/direct/test_shade.py"),
        ("rasterize/files/gltf_nodes.py", "tests/rasterize/test_load_gltf.py"),
        ("bench/plot.py", "tests/bench/test_plot.py"),
    ],
)
def test_a_file_is_covered_by_the_tests_of_its_name_or_its_users(graph: Covering, path: str, test: str) -> None:
    assert test in Table.read(TABLE).covering(path, graph)


def test_tests_that_a_row_of_one_file_asks_for_come_first(graph: Covering) -> None:
    tests = Table.read(TABLE).covering("kernels/vpl/vpl_near.cl", graph)
    assert tests[0] == "tests/techniques/vpl/test_vpl_splat.py"
    assert "tests/techniques/vpl/test_vpl_glossy.py" in tests[1:]


def test_every_file_is_covered_by_tests_that_exist(graph: Covering) -> None:
    table = Table.read(TABLE)
    files = table.files(ROOT, ())
    assert len(files) > 200
    for path in files:
        tests = table.covering(path, graph)
        assert tests, path
        assert all((ROOT / test).is_file() for test in tests), path


def test_equivalent_mutants_of_the_table_exist() -> None:
    table = Table.read(TABLE)
    for row in table.equivalent:
        source = (ROOT / row["path"]).read_bytes()
        every = (Mutant.of(row["path"], edit, source) for edit in edits(row["path"], source))
        assert any(table.proof(mutant) for mutant in every), row


@pytest.mark.slow
def test_mutants_are_killed_or_survive_in_a_copy() -> None:
    path = "ssgi_cl/io/png.py"
    before = (ROOT / path).read_bytes()
    table = Table.read(TABLE)
    table.tests[path] = ["io/test_png.py"]
    campaign = Campaign(ROOT, table, 60.0, lambda text: None)
    at = before.index(b"def ")
    broken = Mutant.of(path, Edit("removed", at, at, "1 / 0\n"), before)
    harmless = Mutant.of(path, Edit("removed", at, at, "1 / 1\n"), before)
    workspace = Workspace(ROOT, caches=False)
    folder = workspace.root
    try:
        found = [campaign.tested(workspace, mutant).status for mutant in (broken, harmless)]
    finally:
        workspace.close()
    assert found == [KILLED, SURVIVED]
    assert (ROOT / path).read_bytes() == before
    assert not folder.exists()


def test_the_score_leaves_equivalent_mutants_out() -> None:
    mutant = Mutant("kernels/ssao/ssao.cl", Edit("sign", 0, 1, ""), 3, "a = -b;", "-")
    results = [Result(mutant, status) for status in (KILLED, KILLED, KILLED, SURVIVED, EQUIVALENT)]
    assert score(results) == "75.0%"
    report = as_markdown(results, seed=7, only=())
    assert "| kernels/ssao | 5 | 3 | 0 | 1 | 1 | 75.0% |" in report
    assert "make mutate MUTATE='--count 5 --seed 7'" in report
