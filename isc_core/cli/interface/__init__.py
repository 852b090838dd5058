"""Shared parts of the commands: options, terminal output, and progress as JSON."""
