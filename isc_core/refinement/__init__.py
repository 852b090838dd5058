"""Refinement of the gloss of a result: lamps, lobe and a little of the shape, so that the rendered
highlights lie where the photo shows them.

Problem: a lobe fitted to the brightness and covered area of the highlights
(`lobe_fitting.recovered`) gives the roughness of a surface. On recovered normals, 10 to 30 degrees
off, its highlights lie elsewhere than those of the photo: rendered, it resembles the photo less
than a rendering without gloss.

Equation: see `gloss_objective`: lamps, roughness, strength and a bounded change of the height are
fitted to the specular layer, and kept if they explain held-out blocks of pixels better
(`gloss_refinement`).

Citation: B. Walter et al., EGSR 2007, doi:10.2312/EGWR/EGSR07/195-206 (the lobe); M. Stone 1974,
doi:10.1111/j.2517-6161.1974.tb00994.x (held-out data).

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
