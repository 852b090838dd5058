"""What does the colour of a photo's light do to the result? Measured on photos.

  python -m benchmarks.decomposition.white_balance PHOTO... [--most .15] [--seed K]

Each photo is decomposed as `isc decompose` does it by default: once as it is, and, unless `--most`
is 0, once with every channel multiplied by a random factor of up to 15 %, as a wrong white balance
does. The table gives the ratio of the strongest to the weakest channel of the recovered light on
the front half of a sphere; the mean angle between the two results' normals; and how far the mean
reflectance moved against the photo: the deviation of the log ratio of its channels from that of the
factors, brightness aside. 0: reflectance moves with the photo.

Limits: photos without truth: the table shows how stable results are, not how right.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from isc_core.decomposition.pipeline import Settings, decompose
from isc_core.errors import InputError
from isc_core.photo import Photo, read_photo
from isc_core.scene.decomposition import Decomposition
from isc_core.shading.spherical_harmonics import real_sh

_NORMALS = 2000


def light_ratio(illumination: np.ndarray) -> float:
    """Compute the ratio of the strongest to the weakest channel of a light.

    Parameters
    ----------
    illumination : (9, 3) ndarray
        Log-shading coefficients, camera frame.

    Returns
    -------
    float
    """
    k = np.arange(_NORMALS) + 0.5
    up, turn = k / _NORMALS, np.pi * (1 + np.sqrt(5)) * k
    across = np.sqrt(1 - up**2)
    normals = np.stack([across * np.cos(turn), across * np.sin(turn), up], axis=-1)
    mean = np.exp(real_sh(normals) @ illumination).mean(axis=0)
    return float(mean.max() / mean.min())


def recoloured(photo: Photo, factor: np.ndarray) -> Photo:
    """Return the photo with its channels multiplied.

    Parameters
    ----------
    photo : Photo
    factor : (3,) ndarray

    Returns
    -------
    Photo
    """
    return replace(photo, image=(photo.image * factor).astype(np.float32))


def changes(before: Decomposition, after: Decomposition, factor: np.ndarray) -> tuple[float, float]:
    """Compare the results of a photo and of the same with its channels multiplied.

    Parameters
    ----------
    before, after : Decomposition
    factor : (3,) ndarray

    Returns
    -------
    normals : float
        Mean angle, degrees.
    off : float
        Root mean square deviation of the change of log mean reflectance from log factor,
        brightness aside.
    """
    mask = before.mask
    cosine = np.einsum("nc,nc->n", before.normal[mask], after.normal[mask])
    angle = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())
    means = [one.reflectance[mask].mean(axis=0, dtype=float) for one in (before, after)]
    off = np.log(means[1] / means[0]) - np.log(factor)
    return angle, float(off.std())


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("photos", type=Path, nargs="+", metavar="PHOTO", help="masked photos")
    add("--most", type=float, default=0.15, help="largest change (default: %(default)s)")
    add("--seed", type=int, default=0, help="of the factors (default: %(default)s)")
    given = parser.parse_args()
    rng, ratios = np.random.default_rng(given.seed), []
    print("| photo | light, strongest / weakest | factors | normals | reflectance off |")
    print("|---|---|---|---|---|")
    for path in given.photos:
        factor = rng.uniform(1 - given.most, 1 + given.most, 3)
        try:
            photo = read_photo(path)
            before = decompose(photo, Settings(threads=1))
        except InputError as error:
            parser.error(str(error))
        ratios.append(light_ratio(before.illumination))
        cells = [path.stem, f"{ratios[-1]:.2f}", "-", "-", "-"]
        if given.most:
            after = decompose(recoloured(photo, factor), Settings(threads=1))
            angle, off = changes(before, after, factor)
            text = " ".join(f"{one:.2f}" for one in factor)
            cells[2:] = [text, f"{angle:.1f}", f"{off:.3f}"]
        print("| " + " | ".join(cells) + " |", flush=True)
    print(f"\nlight: median {np.median(ratios):.2f}, largest {max(ratios):.2f}")


if __name__ == "__main__":
    main()
