"""Starts the program, as `hsplat` or as `python -m hsplat_cli`."""

import sys


def main() -> None:
    """Run the command line of the process, and exit."""
    try:
        # Imported here: Ctrl-C during the import is a message and not a traceback.
        from hsplat_cli.main import main as run

        run()
    except KeyboardInterrupt:
        print("hsplat: interrupted", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
