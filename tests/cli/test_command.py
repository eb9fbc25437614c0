"""The list of commands: quick, true, and helpful about misspelt names."""

from __future__ import annotations

import subprocess
import sys

import pytest
from click.testing import CliRunner

from ssgi_cl.cli.command import COMMANDS, main


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
