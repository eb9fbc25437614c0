"""The command `ssgi devices`."""

from __future__ import annotations

import json
from typing import Any

import click

from ssgi_cl.device import drivers
from ssgi_cl.device.drivers import DeviceInfo
from ssgi_cl.io.console import human_errors, json_option, progress, wrapped


@click.command("devices")
@json_option
@click.option("--refresh", is_flag=True, help="Time all devices anew, whatever is recorded.")
@human_errors
def devices_command(as_json: bool, refresh: bool) -> None:
    """List OpenCL devices, and the build of the kernels that each gets and why.

    What was found is recorded in the cache folder (SSGI_CL_CACHE, or ssgi_cl in the user's caches).
    """
    if refresh:
        drivers.look_again()
    with progress(as_json) as step:
        step("timing devices not seen before")
        found = drivers.devices()
    if as_json:
        print(json.dumps([device_facts(info) for info in found], indent=1))
        return
    if not found:
        reasons = "".join(f"\n{wrapped(reason, '  ')}" for reason in drivers.problems())
        raise click.ClickException(f"no OpenCL device found. {drivers.INSTALL}.{reasons}")
    usable = [info for info in found if info.best is not None]
    chosen = max(usable, key=lambda info: info.speed, default=None)
    for info in found:
        list_device(info, default=info == chosen)
    for reason in drivers.problems():
        click.echo(wrapped(f"Without a device: {reason}", "") + "\n")
    if chosen is None:
        click.echo(wrapped(f"No kernel runs on any of these. {drivers.INSTALL}.", ""))
        return
    click.echo(wrapped(NUMBERS, ""))


NUMBERS = (
    "Numbers are million scattered reads a second with each kernel variant. In use (*) is the widest variant within "
    "15 % of the fastest; on graphics processors one of one lane, unless wider ones are twice as fast."
)


def device_facts(info: DeviceInfo) -> dict[str, Any]:
    """Return what is known of a device, as JSON can hold it."""
    return {
        "label": info.label,
        "kind": info.kind,
        "units": info.units,
        "driver": info.driver,
        "variant": str(info.best),
        "why": info.why,
        "million_reads_per_second": info.speeds,
        **info.facts,
    }


def list_device(info: DeviceInfo, *, default: bool, details: bool = False) -> None:
    """Print a device, the speed of each kernel variant or why it does not run, and which is in use and why.

    With `details` versions, memory and limits too.
    """
    units = f"{info.units} compute unit{'s' if info.units != 1 else ''}"
    click.echo(wrapped(info.label, ""))
    click.echo(f"  {info.kind}, {units}{', used by default' if default else ''}")
    if details and info.facts:
        for line in _details(info.facts):
            click.echo(wrapped(line, "  "))
    for variant in drivers.KERNEL_VARIANTS:
        speed = info.speeds.get(str(variant), "not tried")
        mark = "*" if variant == info.best else " "
        if isinstance(speed, str):
            click.echo(f"  {mark} {variant!s:17} does not run:")
            for line in speed.splitlines():
                if line.strip():
                    click.echo(wrapped(line, " " * 8))
        else:
            why = f"  in use: {info.why}" if variant == info.best else ""
            click.echo(f"  {mark} {variant!s:17} {speed:7.0f}{why}")
    if info.best is None:
        click.echo("  no kernel variant runs on it, so it is not used")
    if info.failures and info.driver:
        click.echo(wrapped(drivers.standing(info), "  "))
    click.echo()


def _details(facts: dict[str, Any]) -> list[str]:
    memory, largest, local, constant = (
        f"{facts[name] / 2**10:.0f} KiB" if facts[name] < 2**20 else f"{facts[name] / 2**20:.0f} MiB"
        for name in ("memory", "largest_allocation", "local_memory", "constant_memory")
    )
    image = "none" if facts["image"] is None else "{} x {}".format(*facts["image"])
    return [
        f"{facts['opencl']}; {facts['opencl_c']}",
        f"memory {memory}, at most {largest} in one piece; local {local}, constant {constant}",
        f"work-groups of {facts['work_group']}, images {image}; {', '.join(facts['extensions']) or 'no extension'}",
    ]
