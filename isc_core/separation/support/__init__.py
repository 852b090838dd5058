"""What several separation methods share."""
