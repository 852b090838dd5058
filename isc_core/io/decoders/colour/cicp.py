"""Coding-independent code points: the primaries and transfer curve of AVIF, HEIF and PNG files.

Citation: Recommendation ITU-T H.273 (2021), "Coding-independent code points for video signal type
identification", tables 2 and 3; Display P3 as SMPTE EG 432-1 (2010).

Limits: the curves of television (1, 6, 14, 15) are treated as sRGB, since cameras label sRGB so.
HDR curves (PQ, HLG) are not supported: their peak is not diffuse white.
"""

from pathlib import Path

import numpy as np

from ....errors import InputError
from .space import LINEAR, ColourSpace, PowerCurve, ToneCurve, colorants_of

_D65 = (0.3127, 0.3290)
_PRIMARIES = {
    4: ("NTSC 1953", ((0.67, 0.33), (0.21, 0.71), (0.14, 0.08), (0.310, 0.316))),
    5: ("BT.470 PAL", ((0.64, 0.33), (0.29, 0.60), (0.15, 0.06), _D65)),
    9: ("BT.2020", ((0.708, 0.292), (0.170, 0.797), (0.131, 0.046), _D65)),
    11: ("DCI-P3", ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), (0.314, 0.351))),
    12: ("Display P3", ((0.680, 0.320), (0.265, 0.690), (0.150, 0.060), _D65)),
}
_CURVES: dict[int, ToneCurve] = {4: PowerCurve(2.2), 5: PowerCurve(2.8), 8: LINEAR}
_HDR = {16: "PQ", 18: "HLG"}


def space_of_code_points(primaries: int, transfer: int, path: Path) -> ColourSpace | None:
    """Return the colour space of code points.

    Parameters
    ----------
    primaries, transfer : int
        Code points of H.273.
    path : Path
        Prefix of the error message.

    Returns
    -------
    ColourSpace or None
        None for sRGB and for unspecified or unknown code points.

    Raises
    ------
    InputError
        For an HDR curve.
    """
    if transfer in _HDR:
        raise InputError(
            f"{path}: an HDR picture with the curve {_HDR[transfer]} is not supported: export it "
            "as an SDR photo, or as an EXR of linear light"
        )
    curves = (_CURVES[transfer],) if transfer in _CURVES else ()
    if primaries in _PRIMARIES:
        name, chromaticities = _PRIMARIES[primaries]
        return ColourSpace(name, curves, colorants_of(np.array(chromaticities)))
    return ColourSpace("Rec.709", curves) if curves else None
