"""Reproduce the figures of the paper, one module a figure; `scenes/` has their scenes.

D. Laur, P. Hanrahan, "Hierarchical Splatting: A Progressive Refinement Algorithm for Volume Rendering", SIGGRAPH 1991.

In each module `measure` draws and counts, `check_claims` compares the numbers with the paper's claims, and
`make_figure` lays out both for the page. `figure.py` alone opens stages and draws; beside it, a figure imports the room
of what it examines: the footprint's triangles (`splats/`), the cut (`pyramid/`), the ray integral (`truth/`), metrics
(`study/`).
"""
