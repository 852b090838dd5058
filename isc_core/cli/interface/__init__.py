"""What every command shares: options, the terminal, and JSON progress."""
