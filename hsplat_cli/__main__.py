"""`python -m hsplat_cli` is `hsplat`."""

from hsplat_cli.main import main

main()
