"""Panels of the contact sheet that show a light on a white sphere."""

from dataclasses import replace

import numpy as np

from ....editing.spheres import render_sphere
from ....result_files.panels import Panel
from ....scene.decomposition import Decomposition
from ....shading.lights import DirectionalLight
from ....shading.sphere import sphere_normals
from ....shading.spherical_harmonics import real_sh


def sphere_panel(color: np.ndarray, label: str, remark: str) -> Panel:
    """Return a panel with a picture of a sphere.

    Parameters
    ----------
    color : (N, N, 3) ndarray
        Linear light; scaled to its own white.
    label, remark : str

    Returns
    -------
    Panel
    """
    coverage = sphere_normals(len(color))[1]
    return Panel(
        color * 0.95 / max(float(np.percentile(color[coverage > 0.5].max(-1), 99.5)), 1e-9),
        coverage,
        label,
        remark,
    )


def recovered_light_panel(d: Decomposition) -> Panel:
    """Return a panel with a white sphere under the recovered light.

    Parameters
    ----------
    d : Decomposition

    Returns
    -------
    Panel
    """
    return sphere_panel(
        np.exp(real_sh(sphere_normals(320)[0]) @ d.illumination),
        "Recovered light",
        "on a white sphere",
    )


def directional_sphere(light: DirectionalLight, exponent: float | None = None) -> np.ndarray:
    """Render a sphere under only the directional part of a light, without the ambient term.

    Parameters
    ----------
    light : DirectionalLight
    exponent : float, optional
        Blinn-Phong exponent of a lobe.

    Returns
    -------
    (N, N, 3) ndarray
    """
    return render_sphere(replace(light, ambient=np.zeros(3)), exponent=exponent)[0]


def empty_panel(label: str, remark: str) -> Panel:
    """Return a panel with an empty sphere.

    Parameters
    ----------
    label, remark : str

    Returns
    -------
    Panel
    """
    return Panel(np.full((320, 320, 3), 0.03), sphere_normals(320)[1], label, remark)
