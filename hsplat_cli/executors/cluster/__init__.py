"""Frames drawn by many machines: those of a Dask cluster, or processes on this one that stand in for it."""
