"""What image files say about their colours: ICC profiles, code points, chunks."""
