"""The pipeline: from one photo to its intrinsic scene characteristics."""
