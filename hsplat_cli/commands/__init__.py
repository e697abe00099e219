"""Declares the commands of `hsplat`, each in a file of its name; `shared_options.py` has the options that they share.

A command reads its options, calls one room, and prints the outcome. `hsplat_cli.main` imports a command when it is
called.
"""
