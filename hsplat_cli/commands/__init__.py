"""The commands of `hsplat`, one file each, named as the command; `shared_options.py` has the options that they share.

Each reads its options, calls one room, and prints the outcome. `hsplat_cli.main` imports a command when it is called.
"""
