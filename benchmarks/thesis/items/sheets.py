"""Figures 4.10 to 4.48: results of every method on single images, as picture sheets.

4.10-4.15 segmentation and inpainting, 4.16-4.24 published separations, 4.25-4.28 Sparse Coding with
SF1, SF2 and both, 4.29-4.31 the thesis' methods with the iterative one and ISC, 4.32-4.34 SIRFS
before and 4.35-4.40 after a separation, 4.41-4.48 photos of real objects.

Limits: it is not known what the thesis shows under each number of this range: the order within it
is this project's. If there are fewer subjects than numbers, the remaining figures show the first
subjects with other settings or models, so that no two figures are the same.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from isc_core.datasets.mit_berkeley import MitBerkeleyObject
from isc_core.errors import InputError
from isc_core.evaluation.evaluate import Estimate
from isc_core.evaluation.image_metrics import highlight_region
from isc_core.evaluation.metrics import mse, truth_normal
from isc_core.shading.spherical_harmonics import light_from_reference

from ..drawing.image_maps import (
    crop_image,
    fit_scale,
    height_colours,
    light_ball,
    mark_pixels,
    normal_image,
    pad_to_aspect,
    signed_error,
)
from ..drawing.panels import COLOURS, characteristic_panels, panel_figure
from ..drawing.style import exposure, image_sheet
from ..images.subject import Subject
from ..measuring.context import Context
from ..measuring.decompositions import decompose_subject
from ..measuring.framework_runs import (
    AFTER,
    BEFORE,
    BOUND,
    SIRFS,
    Framework,
    run_framework,
    score_frameworks,
    subjects_with_truth,
)
from ..measuring.separation_scores import (
    SEGMENTATION,
    SeparatorSetting,
    segment_highlights,
    separate_subject,
    true_layers,
)
from ..report.item import Cell, ItemContent, ItemTable, ThesisItem
from ..report.layer_tables import KINDS
from .characteristics import error_table
from .removal import METHODS
from .segmentation import SETTINGS as SEGMENTATIONS
from .sparse_coding import METHOD as SPARSE_CODING
from .sparse_coding import OURS as SPECULAR_FREE

Rows = list[tuple[str, Sequence[np.ndarray | None]]]
_OPTIMISERS = SEGMENTATIONS[:3]
_INPAINTED = (*_OPTIMISERS, SeparatorSetting("CS, improved", SEGMENTATION))
_PUBLISHED = tuple(
    SeparatorSetting(f"{label}, as published", method, "paper") for label, method in METHODS.items()
)
_IMPROVED = tuple(
    SeparatorSetting(f"{label}, improved", method) for label, method in METHODS.items()
)
_OWN = {"iterative": "tan_2005", "CS": SEGMENTATION, "SC": SPARSE_CODING}
_THESIS = (
    *(SeparatorSetting(f"{label}, improved", method) for label, method in _OWN.items()),
    SeparatorSetting("ISC", "isc"),
)
_THESIS_PUBLISHED = tuple(
    SeparatorSetting(f"{label}, as published", method, "paper") for label, method in _OWN.items()
)
_FREE_OTHERS = (SeparatorSetting("SC, as published", SPARSE_CODING, "paper"), *SPECULAR_FREE[2:])
_LATER = (SIRFS, *(one for one in BEFORE if one.label in ("SC-SIRFS", "MDR-SIRFS")), BOUND)
_FIRST = (SIRFS, *(one for one in BEFORE if one.label != "SC-SIRFS"))
_MODELS = {"mdr": "MDR", "mbp": "MBP", "joint": "joint", "sirfs": "SIRFS alone"}
_PREFERRED = ("Cup", "Helmet", "Basketball", "Goldfish", "Hydrant", "Bag", "Guitar", "Clock")


def subject_for_figure(index: int, subjects: Sequence[Subject], rounds: int) -> tuple[Subject, int]:
    """Select the subject of a figure of a family.

    Parameters
    ----------
    index : int
        Number of the figure within the family, from 0.
    subjects : sequence of Subject
        Subjects of the family.
    rounds : int
        Number of groups of settings.

    Returns
    -------
    subject : Subject
        The subject.
    which : int
        The group of settings.

    Raises
    ------
    InputError
        If there are too few subjects.
    """
    if not subjects or index >= rounds * len(subjects):
        raise InputError(
            f"{len(subjects)} images of this kind are too few for this figure; add more with --data"
        )
    return subjects[index % len(subjects)], index // len(subjects)


def separation_rows(
    subject: Subject, settings: Sequence[SeparatorSetting], seed: int
) -> tuple[Rows, ItemTable]:
    """Build the rows of a sheet of separations, and a table of errors.

    Parameters
    ----------
    subject : Subject
        A subject with known layers.
    settings : sequence of SeparatorSetting
        The methods.
    seed : int
        Random seed.

    Returns
    -------
    rows : Rows
        Truth and photo, then the layers and errors of each setting.
    table : ItemTable
        Errors as numbers.
    """
    diffuse, specular = true_layers(subject)
    mask, gain = subject.mask, exposure(subject.image, subject.mask)
    rows: Rows = [
        (
            "truth",
            [
                crop_image(diffuse, mask, gain),
                crop_image(specular, mask, gain),
                crop_image(subject.image, mask, gain),
            ],
        )
    ]
    nothing, lines = mse(diffuse, subject.image, mask), []
    for setting in settings:
        try:
            found = separate_subject(subject, setting, seed)
        except InputError:
            rows.append((f"{_wrapped(setting.label)}\nrefuses", [None, None, None]))
            lines.append((setting.label, "refuses", "-", "-"))
            continue
        error = mse(diffuse, found.diffuse, mask)
        words = f"MSE × {_short(error / nothing)}" if nothing > 0 else f"RMS {error**0.5:.2g}"
        wrong = signed_error(found.diffuse - diffuse, mask, gain)
        rows.append(
            (
                f"{_wrapped(setting.label)}\n{words}",
                [
                    crop_image(found.diffuse, mask, gain),
                    crop_image(found.specular, mask, gain),
                    wrong,
                ],
            )
        )
        lines.append(
            (
                setting.label,
                f"{error:.3g}",
                _short(error / nothing) if nothing > 0 else "-",
                _share(found.specular, subject),
            )
        )
    header = ("method", "MSE of the diffuse layer", "MSE / doing nothing", "light taken off, %")
    return rows, ItemTable(
        header,
        tuple(lines),
        f"{subject.name}: {_share(specular, subject)} % of the light is specular",
    )


def characteristics_rows(
    context: Context, subject: Subject, frameworks: Sequence[Framework]
) -> Rows:
    """Build the rows of a sheet of characteristics.

    Parameters
    ----------
    context : Context
        The run.
    subject : Subject
        A subject with ground truth.
    frameworks : sequence of Framework
        The frameworks.

    Returns
    -------
    Rows
        Truth and each framework: height, normals, shading, reflectance and light.
    """
    truth = subject.truth
    assert truth is not None
    errors = {
        row.framework: row.errors["average"]
        for row in score_frameworks(context, [subject], frameworks)
    }
    shown: list[tuple[str, Estimate | None]] = [("truth", _known(truth))]
    for framework in frameworks:
        answer = run_framework(context, subject, framework).answer
        words = "refuses" if answer is None else f"error {errors[framework.label]:.3f}"
        shown.append(
            (
                f"{_wrapped(framework.label)}\n{words}",
                None if answer is None else _levelled(answer, truth),
            )
        )
    known_heights = np.isfinite(truth.height)
    heights = np.concatenate(
        [answer.height[known_heights] for _, answer in shown if answer is not None]
    )
    limits = float(heights.min()), float(heights.max())
    return [
        (label, [None] * 5 if answer is None else _maps(answer, truth, limits))
        for label, answer in shown
    ]


def _maps(
    answer: Estimate, truth: MitBerkeleyObject, limits: tuple[float, float]
) -> list[np.ndarray]:
    """Draw the maps of a result; maps of free scale in the scale and exposure of the truth."""
    valid, mask = truth.valid & np.isfinite(truth.height), truth.mask
    colours = [
        crop_image(
            fit_scale(getattr(answer, name), true, valid), valid, exposure(true, valid), mask
        )
        for name, true in (("shading", truth.shading), ("reflectance", truth.reflectance))
    ]
    (true_ball, covered), (own_ball, _) = (
        light_ball(light_from_reference(truth.light)),
        light_ball(answer.light),
    )
    light = crop_image(
        fit_scale(own_ball, true_ball, covered), covered, exposure(true_ball, covered)
    )
    height = np.where(np.isfinite(truth.height), answer.height, np.nan)
    return [
        height_colours(height, mask, limits),
        normal_image(answer.normal, mask),
        *colours,
        pad_to_aspect(light, mask),
    ]


def _known(truth: MitBerkeleyObject) -> Estimate:
    """Return the ground truth as an estimate."""
    light = light_from_reference(truth.light)
    answer = Estimate(
        truth.height, truth_normal(truth.height), truth.shading, truth.reflectance, light
    )
    return _levelled(answer, truth)


def _levelled(answer: Estimate, truth: MitBerkeleyObject) -> Estimate:
    """Shift the heights to a median of 0, since their offset is undetermined."""
    return replace(
        answer, height=answer.height - np.median(answer.height[np.isfinite(truth.height)])
    )


def _masks(kind: str, context: Context) -> ItemContent:
    rows: Rows = []
    lines: list[tuple[Cell, ...]] = []
    names = [setting.label.partition(",")[0] for setting in _OPTIMISERS]
    for subject in context.subjects(kind):
        gain = exposure(subject.image, subject.mask)
        true = highlight_region(true_layers(subject)[1], subject.mask)
        found = [segment_highlights(subject, setting, context.seed) for setting in _OPTIMISERS]
        pictures = [
            mark_pixels(subject.image, subject.mask, pixels, gain) for pixels in (*found, true)
        ]
        rows.append((subject.name, [crop_image(subject.image, subject.mask, gain), *pictures]))
        for name, pixels in zip(names, found, strict=True):
            both = int((pixels & true).sum())
            lines.append(
                (
                    subject.name,
                    name,
                    int(pixels.sum()),
                    _percent(both, int(pixels.sum())),
                    _percent(both, int(true.sum())),
                )
            )
    table = ItemTable(
        ("image", "search", "pixels marked", "precision, %", "recall, %"),
        tuple(lines),
    )
    text = (
        "Orange: the pixels above the highest of three thresholds of the smallest "
        "channel, for each search; in the last column, those whose true specular layer "
        "is above a tenth of its 99.9th percentile."
    )
    return ItemContent(
        (table,), (image_sheet(("photo", *names, "true highlights"), rows, expose=False),), text
    )


def _layers(
    kind: str, rounds: Sequence[Sequence[SeparatorSetting]], index: int, context: Context
) -> ItemContent:
    subject, which = subject_for_figure(index, context.subjects(kind), len(rounds))
    rows, table = separation_rows(subject, rounds[which], context.seed)
    text = (
        f"{subject.name}. Below each name: the diffuse layer's mean square error "
        "relative to doing nothing, or, without a highlight, its RMS error. Errors: "
        "orange where light remains, blue where too much was removed, in full colour "
        "from a tenth of the photo's white."
    )
    return ItemContent(
        (table,),
        (image_sheet(("diffuse", "specular", "photo, then errors"), rows, expose=False),),
        text,
    )


def _characteristics(
    rounds: Sequence[Sequence[Framework]], index: int, context: Context
) -> ItemContent:
    subject, which = subject_for_figure(
        index, subjects_with_truth(context, ("specular", "synthetic")), len(rounds)
    )
    rows = characteristics_rows(context, subject, rounds[which])
    text = (
        f"{subject.name} ({subject.kind}). Below each name the geometric mean of the "
        "six errors. Heights share one range; shading, reflectance and light are "
        f"scaled to the truth; the light is shown on a white ball. {COLOURS}"
    )
    drawn = image_sheet(
        ("height", "normals", "shading", "reflectance", "light"), rows, expose=False
    )
    return ItemContent(
        (error_table(score_frameworks(context, [subject], rounds[which])),), (drawn,), text
    )


def _photo(index: int, context: Context) -> ItemContent:
    order = {name: place for place, name in enumerate(_PREFERRED)}
    subjects = sorted(context.photos(), key=lambda subject: order.get(subject.name, len(order)))
    subject, which = subject_for_figure(index, subjects, len(_MODELS))
    model = list(_MODELS)[which]
    source = (
        "without ground truth"
        if context.has_photos
        else "a rendered object, since no photos were given"
    )
    text = (
        f"{subject.name}, by {_MODELS[model]}; {source}. Photo, diffuse and specular "
        f"layer share an exposure; every other panel has its own. {COLOURS}"
    )
    found = decompose_subject(context, subject, model)
    heights = found.height[found.mask]
    lines = (
        ("light removed, %", _share(found.specular, subject)),
        ("range of heights, pixels", f"{np.ptp(heights):.0f}"),
    )
    return ItemContent(
        (ItemTable(("what", "here"), lines),),
        (panel_figure(characteristic_panels(found), 4),),
        text,
    )


def _share(specular: np.ndarray, subject: Subject) -> str:
    """Return the share of the subject's light in a layer, per cent; sizes may differ."""
    layer = specular.astype(float).sum() / specular.shape[0] / specular.shape[1]
    photo = (
        np.where(subject.mask[..., None], subject.image, 0).astype(float).mean(axis=(0, 1)).sum()
    )
    return f"{100 * layer / max(photo, 1e-30):.2f}"


def _percent(part: int, whole: int) -> str:
    return f"{100 * part / whole:.0f}" if whole else "-"


def _short(value: float) -> str:
    return f"{value:.2g}" if value < 100 else f"{value:.0f}"


def _wrapped(label: str) -> str:
    """Break a row label into lines that fit next to the sheet."""
    return (
        label.replace(", ", ",\n")
        .replace(" with ", "\nwith ")
        .replace(" on the true ", "\non the true\n")
    )


_KINDS = {
    "specular": "significant specularity",
    "synthetic": "a synthetic image",
    "diffuse": "an image without specularity",
}
_Plan = tuple[str, Callable[[Context], ItemContent]]


def _family(
    words: str, kind: str, rounds: Sequence[Sequence[SeparatorSetting]], count: int
) -> list[_Plan]:
    return [
        (f"{words}: {_KINDS[kind]} ({index + 1})", functools.partial(_layers, kind, rounds, index))
        for index in range(count)
    ]


def _plans() -> list[_Plan]:
    plans: list[_Plan] = [
        (f"Highlights detected by PSO, ClonalG and CS: {words}", functools.partial(_masks, kind))
        for kind, words in KINDS.items()
    ]
    for kind in _KINDS:
        plans += _family("Highlights inpainted after PSO, ClonalG and CS", kind, (_INPAINTED,), 1)
    for kind, count in (("specular", 4), ("synthetic", 3), ("diffuse", 2)):
        plans += _family(
            "Layers by MZK06, YCK06, YWA10 and SC09", kind, (_PUBLISHED, _IMPROVED), count
        )
    for kind, count in (("specular", 2), ("synthetic", 1), ("diffuse", 1)):
        plans += _family(
            "Layers by Sparse Coding with SF1, SF2 and both",
            kind,
            (SPECULAR_FREE, _FREE_OTHERS),
            count,
        )
    for kind, count in (("specular", 2), ("synthetic", 1)):
        plans += _family(
            "Layers by the iterative method, CS, SC and ISC",
            kind,
            (_THESIS, _THESIS_PUBLISHED),
            count,
        )
    after, before = ((SIRFS, *AFTER), (SIRFS, AFTER[-1], BOUND)), (_FIRST, _LATER)
    plans += [
        (
            f"Characteristics by SIRFS before a separation ({i + 1})",
            functools.partial(_characteristics, after, i),
        )
        for i in range(3)
    ]
    plans += [
        (
            f"Characteristics by SIRFS after a separation ({i + 1})",
            functools.partial(_characteristics, before, i),
        )
        for i in range(6)
    ]
    return plans + [
        (f"Characteristics of a real object's photo ({i + 1})", functools.partial(_photo, i))
        for i in range(8)
    ]


ITEMS: tuple[ThesisItem, ...] = tuple(
    ThesisItem("figure", f"4.{10 + place}", title, make)
    for place, (title, make) in enumerate(_plans())
)
