"""What several separation methods share: checks, guards, statistics, and the resulting layers."""
