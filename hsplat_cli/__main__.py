"""Starts the program, as `hsplat` or as `python -m hsplat_cli`."""

import importlib
import sys

# Modules of the standard library that Python has on Linux and macOS only.
_SYSTEM_MODULES = ("fcntl", "resource")


def main() -> None:
    """Run the command line of the process, and exit."""
    try:
        for name in _SYSTEM_MODULES:
            importlib.import_module(name)
    except ImportError:
        print("hsplat: this system is not supported; hsplat runs on Linux and macOS", file=sys.stderr)
        sys.exit(1)
    try:
        # Imported here, so that Ctrl-C during the import gives a message and not a traceback.
        from hsplat_cli.main import main as run

        run()
    except KeyboardInterrupt:
        print("hsplat: interrupted", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
