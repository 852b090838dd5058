"""The outcome of a refinement as a line of text."""

from .gloss_refinement import GlossRefinement


def gloss_line(done: GlossRefinement) -> str:
    """Say what became of the gloss.

    Parameters
    ----------
    done : GlossRefinement

    Returns
    -------
    str
        One line.
    """
    if not done.lamps:
        return "the gloss stays: no highlight of known roughness was separated"
    if not done.kept:
        return "the gloss stays: a new one does not explain held-out pixels better"
    lamps = "1 lamp" if done.lamps == 1 else f"{done.lamps} lamps"
    return f"the gloss was refined: {lamps}, {done.after:.0%} of held-out highlights explained"
