"""README and pages with blocks made from the JSON in `docs/figures` and from parameters.

In a page written by hand, each block stands between `<!-- figures:NAME -->` and `<!-- end -->`.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ssgi_cl.bench import document, summary
from ssgi_cl.bench.document import groups
from ssgi_cl.bench.verdict import verdict
from ssgi_cl.bench.wording import revision, title
from tools.figures import skips, summation
from tools.figures.tables import FAMILIES, PAGES, cases_of, indirect_blocks, parameter_blocks, speed_ups, techniques

FOLDER = Path("docs/figures")
"""Of the recorded JSON, seen from the root of the checkout."""

_BLOCK = re.compile(r"(<!-- figures:([\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def filled(text: str, blocks: Mapping[str, str]) -> str:
    """Return a page with what is between its markers replaced.

    Raises:
        ValueError: the page asks for a block that there is none of.
    """

    def one(match: re.Match[str]) -> str:
        if match[2] not in blocks:
            raise ValueError(f"figures:{match[2]} is unknown: expected one of {', '.join(sorted(blocks))}")
        return f"{match[1]}{blocks[match[2]].strip()}\n{match[3]}"

    return _BLOCK.sub(one, text)


def recorded(root: Path, name: str) -> dict[str, Any]:
    """Return what is recorded under a name in a checkout."""
    path = root / FOLDER / f"{name}.json"
    if name in ("benchmark", "indirect"):
        return document.read(path)
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def blocks(benchmark: Mapping[str, Any], indirect: Mapping[str, Any]) -> dict[str, str]:
    """Return name of a block -> Markdown."""
    return {
        "techniques": techniques(benchmark["results"]),
        "speed-ups": speed_ups(benchmark["results"]),
        "machine": machine(benchmark),
        "rays": verdicts(benchmark, ("occlusion",), ("hall", "cornell_box")),
        "indirect-machine": machine(indirect),
        "indirect-verdicts": verdicts(indirect, ("bounce",), None),
        **indirect_blocks(indirect["results"]),
        **{f"cases-{name}": cases_of(benchmark["results"], name) for name in FAMILIES},
        **parameter_blocks(),
    }


def machine(found: Mapping[str, Any]) -> str:
    """Return what was measured on what, from which revision, by which command."""
    device, cpu = found["device"], found["machine"]
    trial = f"**{summary.TRIAL}** " if found.get("quick") else ""
    return trial + (
        f"*Recorded by `make figures` at revision {revision(found)} ({found['created'][:10]}) on "
        f"{device['label']}, {device['variant']}; {cpu['cpu']}, {cpu['threads']} threads.*"
    )


def verdicts(found: Mapping[str, Any], quantities: Sequence[str], scenes: Sequence[str] | None) -> str:
    """Return what the rows of groups say, a list for each group; of all scenes, or of some."""
    lines = [
        "\n".join((f"{title(key)}:\n", *(f"- {each}" for each in said), ""))
        for key, results in groups(found["results"]).items()
        if key[0] in quantities and (scenes is None or key[1] in scenes) and (said := verdict(results))
    ]
    return "\n".join(lines).rstrip()


BY_HAND = ("README.md", "docs/results.md", "docs/indirect.md", *(f"docs/techniques/{name}.md" for name in PAGES))
"""Pages whose text is written by hand, round the blocks."""


def pages(root: Path) -> dict[str, str]:
    """Return path of a page from the root of the checkout -> what it has to be."""
    benchmark = recorded(root, "benchmark")
    made = blocks(benchmark, recorded(root, "indirect"))
    return {
        **{name: filled((root / name).read_text(encoding="utf-8"), made) for name in BY_HAND},
        "docs/benchmark.md": summary.page(benchmark, "benchmark"),
        "docs/skips.md": skips.page(recorded(root, "skips")),
        "docs/summation.md": summation.page(recorded(root, "summation")),
    }


def plots(root: Path) -> dict[str, str]:
    """Return name of a plot of docs/benchmark.md, without its ending -> SVG."""
    return summary.plots(recorded(root, "benchmark"), "benchmark")


def compact(found: Mapping[str, Any]) -> str:
    """Return a document as JSON that is small: a line for each result, numbers of five digits.

    Passes, regions and rates are left out.
    """
    kept = (
        "name",
        "family",
        "setting",
        "scene",
        "size",
        "quantity",
        "counted",
        "note",
        "timed",
        "wall_ms",
        "device_ms",
        "ratio",
        "runs",
        "unsteady",
        "front",
        "near",
    )
    lines = []
    for result in found["results"]:
        short = {name: result[name] for name in kept if name in result}
        short["errors"] = {
            truth: {name: value for name, value in errors.items() if name != "regions"}
            for truth, errors in (result.get("errors") or {}).items()
        }
        short["passes"] = []
        lines.append(json.dumps(rounded(short), ensure_ascii=False, allow_nan=False))
    rest = {name: value for name, value in found.items() if name != "results"}
    head = json.dumps(rounded(rest), indent=1, ensure_ascii=False, allow_nan=False)
    return f'{head[:-2]},\n "results": [\n' + ",\n".join(lines) + "\n ]\n}\n"


def rounded(value: Any) -> Any:
    """Return what JSON can hold, floats of five digits."""
    value = document.plain(value)

    def shorter(item: Any) -> Any:
        if isinstance(item, dict):
            return {key: shorter(part) for key, part in item.items()}
        if isinstance(item, list):
            return [shorter(part) for part in item]
        return float(f"{item:.5g}") if isinstance(item, float) else item

    return shorter(value)
