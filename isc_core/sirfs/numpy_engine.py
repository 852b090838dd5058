"""The SIRFS objective in plain NumPy: always available, and the reference for the compiled
engine.
"""

import numpy as np

from ..shading.irradiance_basis import basis, basis_adjoint
from . import reflectance, surface
from .illumination import light_cost
from .problem import Evaluation, Problem, Terms
from .shading_term import shading_cost
from .silhouette import normals_cost


class NumpyEngine:
    """Evaluate the objective of one problem; sums are always float64.

    Parameters
    ----------
    problem : Problem
    dtype : type
        float32 or float64.
    """

    def __init__(self, problem: Problem, dtype: type[np.floating] = np.float64) -> None:
        self.problem = problem
        self.dtype = np.dtype(dtype)
        self._pixel_weight = problem.reflectance_weight
        self._log_image = np.ascontiguousarray(problem.log_image, self.dtype)

    def evaluate(self, height: np.ndarray, light: np.ndarray) -> Evaluation:
        """Compute the objective and its gradients.

        Parameters
        ----------
        height : (H, W) ndarray
            Pixels toward the viewer.
        light : (9, C) ndarray
            Log-shading coefficients, reference convention.

        Returns
        -------
        Evaluation
        """
        p = self.problem
        g = surface.geometry(np.asarray(height, float), self.dtype)
        functions = basis(g.n1, g.n2, g.n3)
        log_shading = np.einsum("khw,kc->hwc", functions, light.astype(self.dtype))
        log_reflectance = self._log_image - log_shading
        log_reflectance[~p.valid] = 0
        reflectance_terms, d_reflectance = self._reflectance(log_reflectance)
        d_reflectance[~p.valid] = 0
        d_shading = -d_reflectance
        if p.predicted_shading is not None:
            w = p.weights
            reflectance_terms["predicted_shading"], shading_gradient = shading_cost(
                log_shading,
                p.predicted_shading,
                p.valid,
                w.predicted_shading,
                balanced=w.balanced_colour,
            )
            d_shading = d_shading + shading_gradient
        light_gradient = np.einsum("khw,hwc->kc", functions, d_shading, dtype=float)
        d1, d2, d3 = basis_adjoint(
            g.n1, g.n2, g.n3, np.einsum("hwc,kc->khw", d_shading, light.astype(self.dtype))
        )
        shape_terms, height_gradient = self._shape(height, g, d1, d2, d3)
        cost, prior_gradient = light_cost(light.astype(float), p.priors.light, p.weights.light)
        terms = Terms(**reflectance_terms, **shape_terms, light=cost)
        return Evaluation(terms, height_gradient, light_gradient + prior_gradient)

    def _reflectance(self, log_reflectance: np.ndarray) -> tuple[dict[str, float], np.ndarray]:
        p, w = self.problem, self.problem.weights
        if p.shading_only:
            cost, gradient = reflectance.one_color_cost(
                log_reflectance, self._pixel_weight, w.shading_only
            )
            return {"shading_only": cost}, gradient
        smooth, d_smooth = reflectance.smoothness_cost(
            log_reflectance, self._pixel_weight, p.priors, w.smoothness
        )
        parsimony, absolute, d_palette = reflectance.palette_cost(
            log_reflectance, self._pixel_weight, p.priors, w
        )
        return {
            "smoothness": smooth,
            "parsimony": parsimony,
            "absolute": absolute,
        }, d_smooth + d_palette

    def _shape(
        self,
        height: np.ndarray,
        g: surface.Geometry,
        d1: np.ndarray,
        d2: np.ndarray,
        d3: np.ndarray,
    ) -> tuple[dict[str, float], np.ndarray]:
        p, w = self.problem, self.problem.weights
        curvature, dk = surface.curvature_cost(
            g.curvature, p.valid, p.priors.curvature, w.curvature
        )
        slant, d_slant = surface.slant_cost(g.n3, w.slant)
        contour, c1, c2 = surface.contour_cost(
            g.n1, g.n2, p.contour, w.contour, w.contour_power, g.n1.size
        )
        at = (p.contour.rows, p.contour.columns)
        d1[at] += c1.astype(d1.dtype)
        d2[at] += c2.astype(d2.dtype)
        terms = {"curvature": curvature, "slant": slant, "contour": contour}
        if p.silhouette is not None:
            terms["silhouette"], e1, e2 = normals_cost(
                g.n1, g.n2, p.valid, p.silhouette, w.silhouette
            )
            d1, d2 = d1 + e1, d2 + e2
        if p.predicted_normals is not None:
            terms["predicted_normals"], e1, e2 = normals_cost(
                g.n1, g.n2, p.valid, p.predicted_normals, w.predicted_normals
            )
            d1, d2 = d1 + e1, d2 + e2
        gradient = surface.height_gradient(g, d1, d2, d3 + d_slant, dk)
        if p.observation is not None:
            terms["observation"], d_height = surface.observation_cost(height, p.observation)
            gradient = gradient + d_height
        return terms, gradient
