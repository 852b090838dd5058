"""Conversion from the primaries of a colour space to those of Rec.709.

Equation: with the colorants P of the space (CIE XYZ in the columns, their sum is its white w) and
those of Rec.709, S, of the white D65,
    M = S^-1 B^-1 diag(B D65 / B w) B P,
where B is the Bradford matrix of cone responses. White becomes (1, 1, 1), and grey stays grey.

Citation: K. M. Lam (1985), "Metamerism and colour constancy", thesis, University of Bradford;
International Color Consortium, Specification ICC.1:2022, annex E; ITU-R BT.709-6 (2015).

Limits: adaptation of the white by one diagonal matrix. Colours outside of Rec.709 have negative
channels, which `in_rec709` clips at 0; channels above 1 stay.
"""

import numpy as np

from ..io.decoders.colour.space import ColourSpace, colorants_of

REC709 = np.array([[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], [0.3127, 0.3290]])
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)
_SAME = 0.004  # profiles of sRGB differ by their rounding
_ROWS = 64  # converted at a time


def to_rec709(space: ColourSpace | None) -> np.ndarray | None:
    """Return the matrix from linear light in a colour space to linear Rec.709.

    Parameters
    ----------
    space : ColourSpace or None

    Returns
    -------
    (3, 3) ndarray or None
        Its rows sum to 1; None where the primaries are those of Rec.709.
    """
    if space is None or space.colorants is None:
        return None
    target = colorants_of(REC709)
    white, d65 = (_BRADFORD @ colorants.sum(axis=1) for colorants in (space.colorants, target))
    adapted = np.linalg.solve(_BRADFORD, (d65 / white)[:, None] * (_BRADFORD @ space.colorants))
    matrix: np.ndarray = np.linalg.solve(target, adapted)
    if np.abs(matrix - np.eye(3)).max() < _SAME:
        return None
    return matrix


def in_rec709(linear: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Convert linear light to Rec.709; colours outside its gamut are clipped at 0.

    Parameters
    ----------
    linear : (H, W, 3) float32 ndarray
        Pixels with negative or non-finite values are defective and are not changed.
    matrix : (3, 3) ndarray
        From `to_rec709`.

    Returns
    -------
    (H, W, 3) float32 ndarray
    """
    result = np.empty_like(linear)
    for start in range(0, len(linear), _ROWS):
        rows = slice(start, start + _ROWS)
        block = linear[rows]
        if block.min() >= 0 and np.isfinite(block.max()):
            _convert(block, matrix.astype(np.float32), result[rows])
            continue
        sound = (np.isfinite(block) & (block >= 0)).all(axis=2, keepdims=True)
        _convert(np.where(sound, block, 0), matrix.astype(np.float32), result[rows])
        np.copyto(result[rows], block, where=~sound)
    return result


def _convert(light: np.ndarray, matrix: np.ndarray, result: np.ndarray) -> None:
    for channel, (r, g, b) in enumerate(matrix):
        sums = r * light[..., 0]
        sums += g * light[..., 1]
        sums += b * light[..., 2]
        np.maximum(sums, 0, out=result[..., channel])
