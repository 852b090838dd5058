"""The worker: the process that runs `isc` for Blender.

`process` starts, polls and ends any such process; `commands` builds its command lines and its
environment. Nothing here imports Blender.
"""
