"""Labelled arrays in Zarr, written tile by tile, so that a run can be resumed."""
