"""The command `ssgi doctor`: what of OpenCL works on this machine, what does not, and how to mend it."""

from __future__ import annotations

import json
import os
import platform
import sys
from importlib import metadata
from typing import Any

import click

from ssgi_cl.bench.self_test import SECONDS, Outcome, self_test
from ssgi_cl.cli.devices import NUMBERS, device_facts, list_device
from ssgi_cl.core.errors import DeviceError
from ssgi_cl.device import drivers, host_memory
from ssgi_cl.device.drivers import DeviceInfo, diagnosis, records
from ssgi_cl.device.drivers.diagnosis import Problem
from ssgi_cl.io.console import device_option, human_errors, json_option, progress, wrapped
from ssgi_cl.version import __version__


@click.command("doctor")
@device_option
@click.option("--no-test", is_flag=True, help="Leave out the self-test.")
@json_option
@human_errors
def doctor_command(device: str | None, no_test: bool, as_json: bool) -> None:
    """Say what of OpenCL works here, what does not and how to mend it: a report to paste.

    The self-test runs every technique on the default device, or the one that is named, and holds the results to stored
    ones; after 55 s it leaves out the rest. Exit status 1 if there is no device, or a technique fails.
    """
    with progress(as_json) as step:
        step("timing devices not seen before")
        found = drivers.devices()
        try:
            chosen = drivers.choose(device or os.environ.get("SSGI_CL_DEVICE"))
        except DeviceError as error:
            if found and any(info.best for info in found):
                raise  # of another name than there is
            chosen = None
            nothing = str(error)
        outcomes = None
        if chosen is not None and chosen.best is not None and not no_test:
            outcomes = self_test(chosen, chosen.best, SECONDS, lambda name, share: step(f"self-test: {name}", share))
    problems = [diagnosis.driver_problem(reason) for reason in drivers.problems()]
    problems += diagnosis.card_problems(found, drivers.driver_files())
    problems += [diagnosis.failure_problem(info, *failure) for info in found for failure in info.failures.items()]
    if chosen is None:
        problems.append(Problem(nothing.splitlines()[0].rstrip("."), drivers.INSTALL))
    bad = [outcome for outcome in outcomes or () if not outcome.good]
    problems += [
        Problem(
            f"{outcome.technique} fails the self-test: {outcome}",
            "install the newest version of the driver, or use another device; then report this",
        )
        for outcome in bad
    ]
    if as_json:
        print(json.dumps(_facts(found, chosen, outcomes, problems), indent=1))
    else:
        _tell(found, chosen, outcomes, problems)
    if chosen is None or bad:
        sys.exit(1)


def machine_facts() -> dict[str, Any]:
    """Return versions and what of the machine and its variables matters to OpenCL."""
    versions = {"ssgi-cl": __version__, "Python": platform.python_version()}
    for package in ("numpy", "pyopencl", "pocl-binary-distribution", "intel-opencl-rt"):
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return {
        "versions": versions,
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "threads": os.cpu_count(),
        "memory_to_spare": host_memory.share(),
        "variables": [*records.settings(), *_own_variables()],
        "cards": [
            {"address": card.address, "maker": card.maker.name, "module": card.module} for card in diagnosis.cards()
        ],
        "drivers": [str(path) for path in drivers.driver_files()],
    }


def _own_variables() -> list[str]:
    names = ("SSGI_CL_DEVICE", "SSGI_CL_CACHE", "SSGI_CL_IMAGE_LIMIT", "OCL_ICD_VENDORS")
    return [f"{name}={os.environ[name]}" for name in names if name in os.environ]


def _facts(
    found: tuple[DeviceInfo, ...], chosen: DeviceInfo | None, outcomes: list[Outcome] | None, problems: list[Problem]
) -> dict[str, Any]:
    tested = None
    if outcomes is not None:
        tested = [{"technique": each.technique, "good": each.good, "result": str(each)} for each in outcomes]
    return {
        **machine_facts(),
        "devices": [device_facts(info) for info in found],
        "chosen": None if chosen is None else chosen.label,
        "self_test": tested,
        "problems": [vars(problem) for problem in problems],
    }


def _tell(
    found: tuple[DeviceInfo, ...], chosen: DeviceInfo | None, outcomes: list[Outcome] | None, problems: list[Problem]
) -> None:
    machine = machine_facts()
    versions = ", ".join(f"{name} {version}" for name, version in machine["versions"].items())
    for line in (versions, f"{machine['system']}, {machine['threads']} threads", *machine["variables"]):
        click.echo(wrapped(line, ""))
    for card in machine["cards"]:
        click.echo(f"card {card['address']}: {card['maker']}, kernel driver {card['module'] or 'none'}")
    for path in machine["drivers"]:
        click.echo(f"driver {path}")
    click.echo()
    for info in found:
        list_device(info, default=info == chosen, details=True)
    if found:
        click.echo(wrapped(NUMBERS, "") + "\n")
    if chosen is not None and outcomes is not None:
        _tell_outcomes(chosen, outcomes)
    if not problems:
        click.echo("No problem found.")
    for number, problem in enumerate(problems, 1):
        click.echo(wrapped(f"Problem {number}: {problem.what}", ""))
        click.echo(wrapped(f"Mend: {problem.mend}.", "  "))


def _tell_outcomes(chosen: DeviceInfo, outcomes: list[Outcome]) -> None:
    """Print how many techniques agree, and those that differ in any bit."""
    same = [outcome for outcome in outcomes if str(outcome) == "same bits"]
    click.echo(wrapped(f"Self-test on {chosen.label}, {chosen.best}:", ""))
    click.echo(f"  {len(same)} of {len(outcomes)} techniques have the same bits as stored")
    for outcome in outcomes:
        if outcome not in same:
            click.echo(wrapped(f"{outcome.technique}: {outcome}", "  "))
    if any(outcome.problem and outcome.good for outcome in outcomes):
        click.echo(wrapped("What was not in time is compiled by the next run, or by `ssgi warmup`.", "  "))
    click.echo()
