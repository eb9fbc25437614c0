"""`python -m tools.torture`: threads, interrupts, forks, kills, limits, hostile input; from a seed.

Each case runs in a process of its own, so that one that crashes or hangs stops no other. A case is
a function of a seed in `CASES` of a module in this folder, which raises where something is wrong.
"""

from __future__ import annotations

import importlib
import pkgutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import click
from rich.console import Console

import tools.torture

PATIENCE = 300.0
"""Seconds after which a case counts as hanging."""
LINES = 30
"""Of the output of a case that failed."""


@click.command(help=__doc__)
@click.option("--seed", default=1, show_default=True, help="Of all that is random.")
@click.option("--only", multiple=True, help="Cases whose names hold this; may be given again.")
@click.option("--list", "listed", is_flag=True, help="List the cases; run nothing.")
@click.option("--case", help="Run one case in this process.")
def main(seed: int, only: tuple[str, ...], listed: bool, case: str | None) -> None:
    """Run it."""
    if case is not None:
        module, _, name = case.partition(".")
        importlib.import_module(f"tools.torture.{module}").CASES[name](seed)
        return
    chosen = [name for name in _cases() if not only or any(part in name for part in only)]
    if not chosen:
        raise click.UsageError(f"--only {' '.join(only)}: expected parts of {', '.join(_cases())}")
    console = Console(soft_wrap=True, highlight=False, markup=False)
    if listed:
        console.print("\n".join(chosen))
        return
    failed = []
    for name in chosen:
        start = time.monotonic()
        wrong = _run(name, seed)
        outcome = "FAILED" if wrong else "passed"
        console.print(f"{outcome} {time.monotonic() - start:5.0f} s  {name}")
        if wrong:
            console.print(wrong)
            failed.append(name)
    console.print(f"{len(chosen) - len(failed)} of {len(chosen)} passed, seed {seed}")
    if failed:
        raise SystemExit(1)


def _cases() -> Iterator[str]:
    """Give the names of all cases, module.case."""
    for found in pkgutil.iter_modules(tools.torture.__path__):
        if not found.name.startswith("_"):
            module = importlib.import_module(f"tools.torture.{found.name}")
            yield from (f"{found.name}.{case}" for case in getattr(module, "CASES", {}))


def _run(name: str, seed: int) -> str:
    """Return what is wrong with a case, or the empty text."""
    command = [sys.executable, "-m", "tools.torture", "--case", name, "--seed", str(seed)]
    try:
        done = subprocess.run(
            command,
            cwd=Path(__file__).parents[2],
            capture_output=True,
            text=True,
            errors="replace",
            timeout=PATIENCE,
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except subprocess.TimeoutExpired:
        return f"it did not end in {PATIENCE:.0f} s"
    if done.returncode == 0:
        return ""
    said = (done.stdout + done.stderr).splitlines()[-LINES:]
    return "\n".join([f"exit status {done.returncode}", *said])


if __name__ == "__main__":
    main()
