"""The tables and figures of the thesis, one module per group of related numbers."""
