"""Shares of difficult photos among composites.

Problem: targets that are one rendered object, in one piece inside the frame, in front of a sharp
background, teach the network to expect all four.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Difficulty:
    """Shares of difficult photos.

    Attributes
    ----------
    compound : float
        Of the targets: several cut-outs that overlap (`targets.draw_parts`).
    cut : float
        Of the targets: they fill the frame, or are cut by it (`targets.cut_by_frame`).
    defocused : float
        Of the photos: what lies behind the target is defocused (`defocus`).
    banded : float
        Of the objects: bands of another paint (`bands`).
    """

    compound: float = 0.0
    cut: float = 0.0
    defocused: float = 0.0
    banded: float = 0.0


SIMPLE = Difficulty()
DIFFICULT = Difficulty(compound=0.3, cut=0.25, defocused=0.35, banded=0.3)
