"""`python -m tools.mutate`: mutate the code at random, and report what the tests did not notice."""

from __future__ import annotations

import signal
import sys
from itertools import islice
from pathlib import Path

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from tools.mutate.campaign import Campaign
from tools.mutate.draw import drawn
from tools.mutate.results import INVALID, Result, as_json, as_markdown, score
from tools.mutate.table import Table

ROOT = Path(__file__).parents[2]


@click.command(help=__doc__)
@click.option("--count", default=200, show_default=True, help="Mutants to test.")
@click.option("--seed", default=1, show_default=True, help="Of the random choice.")
@click.option("--only", multiple=True, help="File or folder to mutate; may be given again.")
@click.option("--jobs", default=1, show_default=True, help="Mutants tested at a time.")
@click.option(
    "--budget",
    default=120.0,
    show_default=True,
    help="Seconds that the tests of a mutant take without the mutation, at most.",
)
@click.option("--list", "listed", is_flag=True, help="List mutants and their tests; run nothing.")
@click.option(
    "--json",
    "json_path",
    type=click.Path(dir_okay=False, path_type=Path),
    default=ROOT / "build" / "mutation.json",
    help="Results; build/mutation.json.",
)
@click.option(
    "--report",
    type=click.Path(dir_okay=False, path_type=Path),
    default=ROOT / "build" / "mutation.md",
    help="Summary; build/mutation.md.",
)
@click.option("--fail-under", default=0.0, help="Exit 1 where the score is lower, per cent.")
def main(
    count: int,
    seed: int,
    only: tuple[str, ...],
    jobs: int,
    budget: float,
    listed: bool,
    json_path: Path,
    report: Path,
    fail_under: float,
) -> None:
    """Run it."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that copies are removed
    table = Table.read(Path(__file__).with_name("table.toml"))
    paths = table.files(ROOT, only)
    if not paths:
        raise click.UsageError(
            f"--only {' '.join(only)}: expected files or folders of kernels, ssgi_cl, rasterize or bench"
        )
    mutants = drawn(ROOT, paths, seed)
    console = Console(soft_wrap=True, highlight=False, markup=False)
    campaign = Campaign(ROOT, table, budget, console.print)
    if listed:
        for mutant in islice(mutants, count):
            tests = (test.removeprefix("tests/") for test in table.covering(mutant.path, campaign.graph))
            console.print(f"{mutant}  [{' '.join(tests)}]")
        return
    results: list[Result] = []
    columns = (
        TextColumn("mutants"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("", total=count)

        def add(result: Result) -> None:
            took = f"{result.status:9} {result.seconds:5.0f} s"
            console.print(f"{took}  {result.mutant}  {result.by}")
            if result.status == INVALID:
                return
            results.append(result)
            for path, text in ((json_path, as_json), (report, as_markdown)):
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text(results, seed=seed, only=only), encoding="utf-8")
            progress.update(task, advance=1, description=f"score {score(results)}")

        campaign.run(mutants, count, jobs, add)
    console.print(f"score {score(results)}; {report} and {json_path}")
    reached = score(results)
    if reached != "none" and float(reached.rstrip("%")) < fail_under:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
