"""Many photos, one after the other and side by side: `isc batch`.

Inputs become a stream of items (`sources`, `manifest`) with names of their own (`names`). Dask's
scheduler hands them to workers (`engine`), one image a task; a task (`work`) fetches its files
(`fetch`), looks whether its result is there already (`fingerprint`), and writes it whole or not at
all. What hangs or kills its worker is found out (`attempts`). The run (`run`) holds the folder's
lock (`run_folder`), keeps a journal of what came out, and sums it up (`journal`, `summary`).

Limits: the output folder is one that all workers see, on a file system with renames that are atomic
and locks that are held.
"""
