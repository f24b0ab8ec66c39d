"""Where computations run: on a Dask cluster, or in this process when they are asked for."""
