"""Refinement of the gloss of a result: lamps, lobe and a little of the shape, so that the rendered
highlights lie where the photo shows them.

Problem: a lobe that is fitted by its brightness and covered area (`lobe_fitting.recovered`) says
how rough a surface is. On recovered normals, 10 to 30 degrees off, its highlights lie elsewhere
than those of the photo: rendered, it looks less like the photo than no gloss at all.

Equation: see `gloss_objective`: lamps, roughness, strength and a bounded change of the height are
fitted to the specular layer, and kept where blocks of pixels that the fit has not seen are
explained better (`gloss_refinement`).

Citation: B. Walter et al., EGSR 2007, doi:10.2312/EGWR/EGSR07/195-206 (the lobe); M. Stone 1974,
doi:10.1111/j.2517-6161.1974.tb00994.x (pixels held out).

Limits: measured in docs/methods/refine.md. Where no highlight was separated, there is nothing to
fit.
"""

from typing import TYPE_CHECKING

from ..lazy import exports

if TYPE_CHECKING:
    from .gloss_refinement import GlossOptions, GlossRefinement, refine_gloss
else:
    __getattr__ = exports(
        __name__,
        {
            "GlossOptions": ".gloss_refinement",
            "GlossRefinement": ".gloss_refinement",
            "refine_gloss": ".gloss_refinement",
        },
    )

__all__ = ["GlossOptions", "GlossRefinement", "refine_gloss"]
