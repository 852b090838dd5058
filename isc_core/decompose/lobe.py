"""The lobe that a model's specular layer shows on the shape that it recovered, and what is to be
said of it.

Where the shape was given, the fit is to its normals; else to what is left of recovered ones and to
how the light looks, see `lobe_fitting.recovered`.

Limits: those of `lobe_fitting`.
"""

from dataclasses import dataclass

import numpy as np

from ..lobe_fitting import fit_lobe
from ..progress import Monitor
from ..scene.decomposition import Separation
from ..scene.lobe_fit import NO_LIGHT, LobeFit, LobeFitOptions, LobeModel
from ..shading.brdf.roughness import blender_from_alpha
from ..sirfs.priors.prior_file import shipped_prior_set
from ..sirfs.silhouette import outline_normals
from .layers import shaded
from .shape import Shape
from .task import Task

_NOTHING = 0.03  # of the photo's white: specular light that is nowhere brighter is none
MATT = "next to no highlights were found: the object is matt, or they cannot be told from its paint"
HIDDEN = "undetermined: where highlights may be, the photo is too bright to show them"
NOT_LOOKED_FOR = "not fitted: the separator none leaves no highlights to fit it to"
_MUCH_CLIPPED = 0.05  # of the object


@dataclass(frozen=True)
class FittedLobe:
    """`brdf`: the fit, None where no highlights were looked for; `status`: what a person should
    know of it, as the entry "gloss" of a result's status. `clipped`: the share of the object that
    is brighter than the photo could show.
    """

    brdf: LobeFit | None
    clipped: float = 0.0

    @property
    def status(self) -> dict[str, str]:
        """The roughness with its interval, or why it is not determined."""
        fit = self.brdf
        if fit is None:
            return {"gloss": NOT_LOOKED_FOR}
        if fit.reason == NO_LIGHT:
            return {"gloss": HIDDEN if self.clipped > _MUCH_CLIPPED else MATT}
        span = fit.alpha_interval
        if fit.alpha is None or span is None:
            return {"gloss": fit.reason}
        low, likely, high = (
            float(blender_from_alpha(np.clip(alpha, 0, 1)))
            for alpha in (span.low, fit.alpha, span.high)
        )
        if not fit.determined:
            return {"gloss": f"roughness at most {high:.2f}: {fit.reason}"}
        return {
            "gloss": f"roughness {likely:.2f}, {low:.2f} to {high:.2f} with a probability of 68 %"
        }


def fit_specular(
    split: Separation, shape: Shape, task: Task, monitor: Monitor, model: LobeModel = "ggx"
) -> FittedLobe:
    """Fits the lobe to the specular layer of `split` under the normals of `shape`; clipped pixels
    count as lower bounds.

    Where the data cannot tell, the fit says so: that is no error. There is none where nothing
    looked for highlights. Raises `Cancelled`.
    """
    photo = task.maps
    if task.settings.separator == "none" and not split.specular.any():
        return FittedLobe(None)
    with task.clock.stage("gloss"):
        normal, shading = shaded(shape.height, shape.light, photo.mask)
        white = float(np.percentile(photo.image[photo.mask].max(axis=1), 99.5))
        options = LobeFitOptions(
            model, darkest=_NOTHING * white, thresholded=True, recovered=task.known.height is None
        )
        profile = (task.prior_set or shipped_prior_set()).silhouette
        fit = fit_lobe(
            split.specular,
            normal,
            photo.mask,
            options=options,
            clipped=photo.clipped,
            height=shape.height,
            shading=shading,
            outline=outline_normals(photo.mask, profile) if options.recovered else None,
            light_estimate=task.light_estimate,
            monitor=monitor,
        )
        return FittedLobe(fit, float(photo.clipped[photo.mask].mean()))
