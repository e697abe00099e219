"""Draws frames on a Dask cluster, or on processes of this machine that stand in for one."""
