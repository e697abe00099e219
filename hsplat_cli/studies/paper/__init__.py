"""`hsplat paper`: the figures of the paper, drawn anew and measured, one module for each figure.

D. Laur, P. Hanrahan, "Hierarchical Splatting: A Progressive Refinement Algorithm for Volume Rendering", SIGGRAPH 1991.

In each module `measure` draws and counts, `judge` turns the numbers into verdicts and nothing else, and `make` lays out
both for the page.
"""
