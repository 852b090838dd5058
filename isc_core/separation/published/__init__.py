"""Published separation methods, one a file, named by author and year."""
