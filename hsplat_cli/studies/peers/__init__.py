"""Measure other programs on hsplat's scenes, with hsplat's truths and metrics.

A peer must get the same scene, so this room translates each part of it: voxels (`volume/`), transfer function
(`transfer/`) and cameras (`view/`). Its pictures are judged by `study/`, as hsplat's own.
"""
