"""What every command shares: options, the terminal, and progress as JSON."""
