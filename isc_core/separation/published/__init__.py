"""Published separation methods, one per file, named by author and year."""
