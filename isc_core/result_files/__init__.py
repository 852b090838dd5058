"""The files of a result: maps, mesh, contact sheet and records."""
