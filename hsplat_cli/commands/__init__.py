"""The commands of `hsplat`, one file each, named as the command.

Each reads its options, calls one room, and prints what came of it. `hsplat_cli.main` imports them when they are called.
"""
