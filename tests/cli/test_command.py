"""The list of commands: quick, true, and helpful about misspelt names."""

from __future__ import annotations

import re
import subprocess
import sys

import click
import pytest
from click.testing import CliRunner

from ssgi_cl.cli.apply import apply_command
from ssgi_cl.cli.command import COMMANDS, main
from ssgi_cl.cli.render import render_command
from ssgi_cl.io.console import GroupedCommand


def test_help_imports_no_part_of_the_library() -> None:
    code = (
        "import sys; from ssgi_cl.cli.command import main; main(['--help'], standalone_mode=False); "
        "print(*(name for name in sys.modules if name.startswith(('numpy', 'pyopencl', 'ssgi_cl.'))))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.splitlines()[-1].split())
    assert loaded <= {"ssgi_cl.cli", "ssgi_cl.cli.command", "ssgi_cl.core", "ssgi_cl.core.formats", "ssgi_cl.version"}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_where_the_list_says(name: str) -> None:
    result = CliRunner().invoke(main, [name, "--help"])
    assert result.exit_code == 0
    assert result.output.startswith(f"Usage: main {name} ")
    assert f"  {name} " in CliRunner().invoke(main, ["--help"]).output


def test_a_misspelt_command_names_the_nearest() -> None:
    result = CliRunner().invoke(main, ["rendr"])
    assert result.exit_code == 2
    assert "No such command 'rendr'. Did you mean 'render'?" in result.output
    assert "There are apply, bench" in CliRunner().invoke(main, ["xyz"]).output


@pytest.mark.parametrize("command", [render_command, apply_command], ids=lambda command: command.name)
def test_each_option_is_under_one_heading(command: GroupedCommand) -> None:
    grouped = [name for names in command.groups.values() for name in names]
    options = [param.name for param in command.params if isinstance(param, click.Option)]
    assert sorted(grouped) == sorted(options)
    text = CliRunner().invoke(main, [str(command.name), "--help"]).output
    headings = re.findall(r"^(\w[^\n]*):$", text, re.MULTILINE)
    assert headings == [*command.groups, "Other options"]
    assert text.split("Other options:\n")[1].split() == ["-h,", "--help", "Show", "this", "message", "and", "exit."]
    options_by_name = {param.name: param for param in command.params}
    first = [options_by_name[name].opts[0] for name in grouped]
    places = [re.search(rf"^  {name}\b", text, re.MULTILINE) for name in first]
    starts = [place.start() for place in places if place is not None]
    assert len(starts) == len(first)
    assert starts == sorted(starts)


def test_an_option_without_a_heading_is_listed_last() -> None:
    @click.command(cls=GroupedCommand, groups={"First": ("b",), "Empty": ()})
    @click.option("--a", help="of no heading")
    @click.option("--b", help="of the first")
    def command(**_: object) -> None:
        pass

    lines = CliRunner().invoke(command, ["--help"]).output.splitlines()
    assert "Empty:" not in lines
    assert lines[lines.index("First:") + 1].split()[:2] == ["--b", "TEXT"]
    assert lines[lines.index("Other options:") + 1].split()[:2] == ["--a", "TEXT"]
