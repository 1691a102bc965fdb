"""Many machines and many recordings: each examined on Dask, the results in one table and on one page."""
