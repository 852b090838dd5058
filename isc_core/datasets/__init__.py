"""Readers of data sets with ground truth."""

from .highlight_set import SeparationTruth, load_laboratory, load_rendered, load_shen_zheng
from .mit_berkeley import MitBerkeleyObject, list_objects, load_object

__all__ = [
    "MitBerkeleyObject",
    "SeparationTruth",
    "list_objects",
    "load_laboratory",
    "load_object",
    "load_rendered",
    "load_shen_zheng",
]
