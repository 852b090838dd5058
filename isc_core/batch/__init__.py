"""Many photos in parallel: `isc batch`.

Inputs become a stream of items (`sources`, `manifest`), each with a unique name (`names`). Dask's
scheduler sends them to workers (`engine`), one image per task. A task (`work`) fetches its files
(`fetch`), checks whether its result exists already (`fingerprint`), and writes it completely or not
at all. `attempts` identifies images that hang or kill their worker. The run (`run_batch`) holds the
lock of its folder (`run_folder`), keeps a journal of outcomes and summarises it (`journal`,
`summary`).

Limits: the output folder must be visible to all workers, on a file system with atomic renames and
locks.
"""
