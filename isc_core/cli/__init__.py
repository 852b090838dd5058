"""The command line: `isc` and its sub-commands."""
