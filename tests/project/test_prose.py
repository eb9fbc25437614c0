"""Pages, comments and docstrings: the files and names that they state, links, parts and examples."""

from __future__ import annotations

import importlib
import re
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path

import pytest

import ssgi_cl as gi
from ssgi_cl.core.params import describe
from ssgi_cl.techniques import catalogue
from tools.figures import tables

ROOT = Path(__file__).parents[2]

PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "kernels/README.md")
    if not {"generated", "_build"} & set(path.relative_to(ROOT).parts)  # of the site
)

NAME = r"[A-Za-z_]\w*"
TRIPLE = r'"""(?:\\.|[^\\])*?"""'
PYTHON = re.compile(
    rf"(?P<said>^[ ]*{TRIPLE}|#[^\n]*)|(?P<string>{TRIPLE}|'''.*?'''"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'(?:\\.|[^'\\\n])*')",
    re.MULTILINE | re.DOTALL,
)
"""Comments, docstrings and other strings of Python."""
LINK = re.compile(r"(?<!`)!?\[[^\]]*\]\(([^)\s]+)\)")


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def said_and_code(name: str) -> tuple[str, str]:
    """Return what a file says to readers, in comments, docstrings or as a page, and its code."""
    content = text(name)
    if name.endswith(".md"):
        return re.sub(r"^```.*?^```", "", content, flags=re.DOTALL | re.MULTILINE), ""
    if name.endswith((".cl", ".clh")):
        comment = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
        return "\n".join(comment.findall(content)), comment.sub(" ", content)
    if not name.endswith(".py"):
        return "", content
    said = "\n".join(match["said"] for match in PYTHON.finditer(content) if match["said"])
    return said, PYTHON.sub(lambda match: match["string"] or " ", content)


def resolves(name: str) -> bool:
    """Whether a name with dots is of a module or of what is in one; public names come first."""
    owner = gi
    try:
        for part in name.split(".")[1:]:
            owner = getattr(owner, part, None) or importlib.import_module(f"{owner.__name__}.{part}")
    except ImportError:
        return False
    return True


def absent(said: str, *, kernel: bool, files: Collection[str], words: Collection[str]) -> list[str]:
    """Return the files, functions, modules and parameters that a text names and that don't exist.

    In comments of kernels all words with an underscore are names, elsewhere those in backticks. A
    letter or sum with an index is of a formula, CL_NAME of OpenCL; a folder or file in capitals stands for all.
    """
    quoted = re.findall(rf"`({NAME}(?:\.{NAME})*)(?:\(\))?`", said)
    if kernel:
        quoted += re.findall(r"(?<![\w./-])[a-z]\w+_\w+\b(?!\.\w)", said)
    missing = {
        name
        for name in quoted
        for word in name.split(".")
        if word not in words and not re.fullmatch(r"([A-Za-z]\d?|sum|CL)(_\w+)?|[A-Z]+|\w+_", word)
    }
    missing |= {name for name in re.findall(rf"`(ssgi_cl(?:\.{NAME})+)`", said) if not resolves(name)}
    paths = re.findall(r"(?<![\w./<{*-])(\w[\w-]*/[\w./-]+\.(?:py|cl|clh|md|sh|json|toml))\b", said)
    lines = "".join(f"/{path}\n" for path in files)
    missing |= {path for path in paths if f"/{path}\n" not in lines and not re.search(r"\b(test_)?[A-Z]+\b", path)}
    return sorted(missing)


@pytest.fixture(scope="module")
def tracked() -> list[str]:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False).stdout
    return [name for name in listed.split() if (ROOT / name).is_file()] or pytest.skip("not a git checkout")


def test_comments_docstrings_and_pages_name_what_exists(tracked: list[str]) -> None:
    kinds = (".py", ".cl", ".clh", ".md", ".json", ".sh", ".toml", "Makefile")
    parts = {name: said_and_code(name) for name in tracked if name.endswith(kinds)}
    words = {word for _, code in parts.values() for word in re.findall(NAME, code)}
    words |= {word for name in tracked for word in (*Path(name).parts, Path(name).stem)}
    found = {
        name: absent(said, kernel=name.startswith("kernels/"), files=tracked, words=words)
        for name, (said, _) in parts.items()
        if name != "CHANGELOG.md"
    }
    assert not {name: names for name, names in found.items() if names}


@pytest.mark.parametrize(
    ("said", "kernel"),
    [
        ("// from slices_near", True),
        ("see `walls_of()`", False),
        ("`ssgi_cl.device.walls`", False),
        ("in kernels/a.clh.", True),
    ],
)
def test_a_name_of_nothing_is_found(said: str, kernel: bool) -> None:
    words = {"ssgi_cl", "device", "walls", "slices_far"}
    assert absent(said, kernel=kernel, files=["kernels/b.clh"], words=words)
    assert not absent("slices_far of x_i in `walls`, kernels/b.clh", kernel=True, files=["kernels/b.clh"], words=words)


def test_readme_is_short() -> None:
    assert len(text("README.md").splitlines()) < 150


@pytest.mark.parametrize("name", PAGES)
def test_links_of_pages_resolve(name: str) -> None:
    folder = (ROOT / name).parent
    links = [link.partition("#")[0] for link in LINK.findall(text(name)) if "://" not in link]
    missing = [link for link in links if link and not (folder / link).exists()]
    assert not missing


def test_every_page_can_be_reached_from_readme() -> None:
    reached, waiting = set(), ["README.md"]
    while waiting:
        name = waiting.pop()
        if name in reached:
            continue
        reached.add(name)
        for link in LINK.findall(text(name)):
            path = ((ROOT / name).parent / link.partition("#")[0]).resolve()
            if path.suffix == ".md" and path.is_file():
                waiting.append(path.relative_to(ROOT).as_posix())
    assert reached == set(PAGES)


def test_walks_name_what_exists() -> None:
    page = text("ARCHITECTURE.md")
    rows = re.findall(r"^\| [^|]+ \| `([^`]+)` \| `(\w+)` \|$", page, re.MULTILINE)
    assert len(rows) >= 16
    missing = [
        (path, name)
        for path, name in rows
        if not re.search(rf"(def|class|void|vfloat|vmask|bool|^) ?{name}\b", text(path), re.MULTILINE)
    ]
    assert not missing


@pytest.mark.parametrize("name", tables.PAGES)
def test_pages_of_techniques_have_all_their_parts(name: str) -> None:
    page = text(f"docs/techniques/{name}.md")
    headings = re.findall(r"^## (.*)$", page, re.MULTILINE)
    assert [head.partition(" from ")[0] for head in headings] == ["Method", "Parameters", "Cost", "Error", "Departures"]
    assert page.startswith(f"# {name}: ")
    assert f"](../images/{name}.png)" in page
    assert f"`python -m tools.technique_pictures {name}`" in page
    assert re.search(r"\b(19|20)\d\d\b", page.partition("## ")[0])
    assert f"[{name}]({name}.md)" in text("docs/techniques/README.md")


def test_every_public_technique_has_a_page_and_every_parameter_a_row() -> None:
    functions = {name for name, value in vars(catalogue).items() if name in catalogue.TECHNIQUES and callable(value)}
    assert functions <= set(tables.PAGES)
    assert {f"docs/techniques/{name}.md" for name in (*tables.PAGES, "README")} == {
        page for page in PAGES if page.startswith("docs/techniques/")
    }
    public = {getattr(gi, name) for name in dir(gi) if name.endswith("Params")}
    public -= {gi.FrameParams, gi.WholeFrameParams}  # of whole frames, which `render` describes
    assert public <= set(tables.PARAMETERS.values())
    for name, params in tables.PARAMETERS.items():
        page = text(f"docs/techniques/{name.partition('-')[0]}.md")
        rows = re.findall(rf"figures:parameters-{name} -->\n(.*?)<!-- end -->", page, re.DOTALL)
        shown = re.findall(r"^\| `(\w+)` \| ([^|]*) \|", rows[0], re.MULTILINE)
        assert shown == [(field, default) for field, default, _ in describe(params)]


def test_pictures_of_pages_are_small_and_all_used() -> None:
    shown = {Path(link).name for page in PAGES for link in LINK.findall(text(page)) if "images/" in link}
    kept = {path.name: path.stat().st_size for path in (ROOT / "docs/images").iterdir()}
    assert shown == set(kept)
    assert max(kept.values()) < 256 * 1024  # three panels of 320 x 240 pixels


def test_the_example_of_readme_runs_as_it_stands(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", text("README.md"), re.DOTALL)
    assert len([line for line in code.splitlines() if line]) <= 11
    done = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning:__main__", "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "hall.png").stat().st_size > 10_000
    assert "gtao" in done.stdout
