"""What holds for any photo, mask and options: laws, tried on drawn cases.

`python -m benchmarks.properties --help`; docs/properties.md.
"""
