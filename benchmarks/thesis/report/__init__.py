"""Content of items (tables, verdicts) and the files written from it."""
