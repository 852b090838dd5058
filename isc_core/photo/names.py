"""The names of the transfer curves; without imports, for a command line that starts fast."""

TRANSFERS = ("auto", "srgb", "linear")
