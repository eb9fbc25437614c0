"""The program `ssgi`: starts the command line, whose modules take seconds to import.

It imports next to nothing itself, so that an interrupt meanwhile ends without a traceback.
"""

from __future__ import annotations

import sys


def main() -> int:
    """Run the command line; return the exit status where it can't even start."""
    try:
        from ssgi_cl.cli.command import main as command
    except KeyboardInterrupt:
        print("Aborted!", file=sys.stderr)  # as click says it
        return 1
    except (MemoryError, ImportError, OSError) as error:
        memory = isinstance(error, MemoryError) or "map segment" in str(error)
        reason = "out of memory (see ulimit -v)" if memory else f"{error}"
        print(f"Error: ssgi can't start: {reason}", file=sys.stderr)
        return 1
    command()
    return 0


if __name__ == "__main__":
    sys.exit(main())
