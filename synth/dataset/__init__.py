"""Data sets of rendered scenes: which scenes a run holds (`splits`), their files (`scene_folder`,
`description`, `card`), making them (`run`) and reading them again (`reading`).
"""
