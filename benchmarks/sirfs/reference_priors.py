"""Read the trained constants of the SIRFS reference release, for comparison only.

They are under research terms and never ship with the project.
"""

from pathlib import Path

import numpy as np

from isc_core.sirfs.priors.priors import AbsoluteTable, LightPrior, Priors
from isc_core.sirfs.priors.tabulated_potential import TabulatedPotential


def reference_priors(path: Path, illumination: str, channels: int = 3) -> Priors:
    """Read the priors of the reference release.

    Parameters
    ----------
    path : Path
        `sirfs_reference_priors.npz`.
    illumination : {"natural", "laboratory"}
        Which lights.
    channels : {3, 1}, optional
        Colour or grey.

    Returns
    -------
    Priors
        The priors.
    """
    with np.load(path, allow_pickle=False) as f:
        d = {k: f[k] for k in f.files}
    kind = f"light_{'color' if channels == 3 else 'gray'}_{illumination}_"
    light = LightPrior(d[kind + "mu"], d[kind + "Sigma"], d[kind + "inverse"], d[kind + "mean"])
    curvature = TabulatedPotential(
        float(d["z_curv_lut_low"]), float(d["z_curv_lut_step"]), d["z_curv_lut_cost"]
    )
    if channels == 1:
        low, high = (float(v) for v in d["gray_a_abs_range"])
        values = d["gray_a_smooth_lut_cost"]
        smooth = TabulatedPotential(-3.925369950195567, 3.925566228506992e-04, values)
        return Priors(
            1,
            curvature,
            smooth,
            np.eye(1),
            np.eye(1),
            AbsoluteTable(low, high, d["gray_a_abs_cost"]),
            light,
        )
    smooth = TabulatedPotential(
        float(d["a_smooth_lut_low"]),
        float(d["a_smooth_lut_step"]),
        float(d["a_smooth_LL_zero"]) - d["a_smooth_lut_loglik"],
    )
    table = AbsoluteTable(
        float(d["a_abs_low"][0]), float(d["a_abs_high"][0]), d["a_abs_cost_RETRAINED"]
    )
    return Priors(3, curvature, smooth, d["a_smooth_whiten"], d["a_whiten"], table, light)
