"""Results of mutants, and the report."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import PurePosixPath

from tools.mutate.edits import Mutant

KILLED, SURVIVED, TIMEOUT, EQUIVALENT, INVALID = ("killed", "survived", "timed out", "equivalent", "invalid")


@dataclass(frozen=True)
class Result:
    """Result of a mutant.

    Attributes:
        mutant: the mutant.
        status: one of the above.
        by: the test that failed; of an equivalent one, why it is.
        tests: test files that were run.
        seconds: how long that took.
    """

    mutant: Mutant
    status: str
    by: str = ""
    tests: tuple[str, ...] = ()
    seconds: float = 0.0


def folder(path: str) -> str:
    """Return the group of a file in the report."""
    parts = PurePosixPath(path).parts[:-1]
    return "/".join(parts[:2])


def score(results: list[Result]) -> str:
    """Return the share of mutants that were found, of those that are not equivalent."""
    counts = Counter(result.status for result in results)
    found = counts[KILLED] + counts[TIMEOUT]
    whole = found + counts[SURVIVED]
    return f"{found / whole:.1%}" if whole else "none"


def as_json(results: list[Result], *, seed: int, only: tuple[str, ...]) -> str:
    """Return the results as a JSON document."""
    rows = [{**asdict(result), "shown": str(result.mutant)} for result in results]
    return json.dumps({"seed": seed, "only": list(only), "score": score(results), "mutants": rows}, indent=1) + "\n"


def as_markdown(results: list[Result], *, seed: int, only: tuple[str, ...]) -> str:
    """Return the report: score by folder and by kind, survivors, and equivalent mutants."""
    command = f"make mutate MUTATE='--count {len(results)} --seed {seed}"
    command += "".join(f" --only {path}" for path in only) + "'"
    lines = ["# Mutation testing", "", f"`{command}`: {len(results)} random mutations, {score(results)} found.", ""]
    groups: dict[str, Callable[[Result], str]] = {
        "Folder": lambda result: folder(result.mutant.path),
        "Kind": lambda result: result.mutant.edit.kind,
    }
    for title, group in groups.items():
        lines += [
            f"| {title} | mutants | killed | timed out | equivalent | survived | score |",
            "|---|---|---|---|---|---|---|",
        ]
        for name in [*sorted({group(result) for result in results}), "all"]:
            rows = [result for result in results if name in (group(result), "all")]
            counts = Counter(result.status for result in rows)
            lines.append(
                f"| {name} | {len(rows)} | {counts[KILLED]} | {counts[TIMEOUT]} | "
                f"{counts[EQUIVALENT]} | {counts[SURVIVED]} | {score(rows)} |"
            )
        lines.append("")
    for status, title in ((SURVIVED, "Survivors"), (EQUIVALENT, "Equivalent")):
        rows = [result for result in results if result.status == status]
        if rows:
            lines += [f"## {title}", ""]
            lines += [f"- `{result.mutant}`" + (f": {result.by}" if result.by else "") for result in rows]
            lines.append("")
    return "\n".join(lines)
