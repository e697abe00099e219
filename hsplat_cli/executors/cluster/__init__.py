"""Draws frames on a Dask cluster."""
