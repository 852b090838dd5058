"""What becomes of results when disks, files, clocks and processes fail.

`python -m benchmarks.faults --help`; docs/faults.md.
"""
