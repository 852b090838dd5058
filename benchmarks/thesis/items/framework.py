"""Figures 3.2 to 3.4 and 3.9 to 3.11: the stages of the framework, of Chaotic Segmentation, Sparse
Coding, MBP and MDR, in real runs.

Every picture is an intermediate result of the functions that separate and decompose, on the subject
with the most specular light; nothing is drawn by hand. Specular layers have the photo's exposure.

Citation: H. Akbar, "3D Intrinsic Scene Characteristics Extraction Framework for a Single Image",
thesis (2016).

Limits: the thesis' own drawings are not public; the assignment of stages to the numbers 3.2 to 3.4
and 3.9 to 3.11 is this project's.
"""

from dataclasses import replace
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from isc_core.decomposition.mbp import split_reflectance
from isc_core.editing.relight import NewLight, relight
from isc_core.imaging.channels import smallest
from isc_core.lobe_fitting.light_direction import explain_shading
from isc_core.result_files.diagnostics_text import outcome_text
from isc_core.scene.decomposition import Decomposition
from isc_core.separation import separate
from isc_core.separation.chaotic_segmentation import (
    VARIANTS,
    ChaoticSegmentationOptions,
    find_specular,
)
from isc_core.separation.sparse_coding import stages
from isc_core.separation.support.specular_free import fixed_chromaticity, two_band
from isc_core.shading.lights import turn, turned_light
from isc_core.thresholding import OtsuObjective, exact, maximise, quantise

from ..drawing.panels import (
    COLOURS,
    Panel,
    characteristic_panels,
    light_panel,
    normals_panel,
    panel_figure,
)
from ..drawing.style import LETTERS, OKABE_ITO, exposure, figure, legend, show_map
from ..images.subject import Subject
from ..measuring.context import Context
from ..measuring.decompositions import decompose_subject, subject_as_photo
from ..report.item import ItemContent, ItemTable, ThesisItem

_LEVELS = 255
_LEAST_EXPLAINED = 0.1  # share of the specular layer, below which a lobe's picture needs a warning


def _subject(context: Context) -> Subject:
    """Select the subject with the most specular light among those with a silhouette."""

    def share(subject: Subject) -> float:
        specular = np.zeros(1) if subject.specular is None else subject.specular[subject.mask]
        return float(specular.sum(dtype=float) / subject.image[subject.mask].sum(dtype=float))

    subjects = context.subjects("specular")
    return max([one for one in subjects if not one.mask.all()] or subjects, key=share)


def _framework(context: Context) -> ItemContent:
    """Figure 3.2: from the photo to the picture under another light."""
    subject = _subject(context)
    d = decompose_subject(context, subject)
    gain = exposure(d.image, d.mask)
    shown = characteristic_panels(d)
    shown += _lobe_panel(d, "the fitted lobe", gain)
    sun = explain_shading(d).light.direction
    white = np.repeat(np.maximum(d.normal @ sun, 0)[..., None], 3, axis=2)
    shown.append(Panel("white, under the single light that explains most", white, d.mask, gain=0.9))
    turned = relight(d, NewLight(coefficients=turned_light(d.illumination, turn(yaw=70))))
    shown.append(Panel("relit: the light turned by 70°", turned.image, d.mask, gain=gain))
    rebuilt = d.reflectance * d.shading + d.specular
    shown.append(Panel("rebuilt: reflectance × shading + specular", rebuilt, d.mask, gain=gain))
    seconds = tuple((name, float(value)) for name, value in d.provenance.timings.items())
    table = ItemTable(("stage", "seconds"), seconds, f"{subject.name}: time per stage.")
    text = (
        f"{subject.name}: specular removal, shape, light, shading and reflectance, the "
        f"lobe, and applications.{_lobe_words(d)} {COLOURS}"
    )
    return ItemContent((table,), (panel_figure(shown, 4),), text)


def _segmentation(context: Context) -> ItemContent:
    """Figure 3.3: the stages of Chaotic Segmentation."""
    subject = _subject(context)
    image, mask = _inside(subject)
    gain = exposure(image, mask)
    low = smallest(image)
    published = VARIANTS["paper"]
    levels, thresholds = _thresholds(image, mask, published, context.seed)
    classes = np.digitize(levels, thresholds, right=True).astype(float)
    shown = [
        Panel("photo", image, mask, gain=gain),
        Panel("smallest channel", np.repeat(low[..., None], 3, axis=2), mask, gain=gain),
        Panel(f"classes of {len(thresholds)} chaotic thresholds", classes, mask),
    ]
    rows = []
    for name, variant in (("as published", "paper"), ("ours", "improved")):
        options = replace(VARIANTS[variant], seed=context.seed)
        found = find_specular(image / float(image.max()), mask, options)
        split = separate(
            "chaotic_segmentation", image, mask, variant=variant, changes={"seed": context.seed}
        )
        hole = np.where(found[..., None], 0, image)
        shown += [
            Panel(f"{name}: specular pixels cut out", hole, mask, gain=gain),
            Panel(f"{name}: inpainted, diffuse", split.diffuse, mask, gain=gain),
            Panel(f"{name}: specular", split.specular, mask, gain=gain),
        ]
        rows.append(
            (name, options.levels, 100 * float(found[mask].mean()), *_left(subject, split.diffuse))
        )
    header = ("variant", "thresholds K", "specular pixels (%)", "diffuse error / doing nothing")
    text = (
        f"{subject.name}. As published: pixels above the highest of three thresholds "
        "are replaced completely, from patches of the rest. Improved: one threshold, a "
        "rim around it, and only white light is removed, by the ratio of the channels "
        "in the patches."
    )
    return ItemContent((ItemTable(header, tuple(rows)),), (panel_figure(shown, 3),), text)


def _search(context: Context) -> ItemContent:
    """Figure 3.4: the threshold search of Chaotic Segmentation."""
    subject = _subject(context)
    image, mask = _inside(subject)
    published = VARIANTS["paper"]
    levels, thresholds = _thresholds(image, mask, published, context.seed)
    objective = OtsuObjective.of(levels[mask])
    rows: list[tuple[str, str, float, int | str]] = []
    best = exact(objective, published.levels)
    made, axes = figure(1, 3, height=3.0)
    _histogram(axes[0, 0], levels[mask], thresholds)
    place = axes[0, 1]
    budget = 2_000 if context.quick else published.evaluations
    for name, colour in zip(
        ("chaotic_clonal", "clonal_selection", "particle_swarm"), OKABE_ITO, strict=False
    ):
        found = maximise(name, objective, published.levels, evaluations=budget, seed=context.seed)
        place.step(
            found.history[:, 0],
            1 - found.history[:, 1] / best.value + 1e-7,
            where="post",
            color=colour,
            label=name.replace("_", " "),
        )
        needed = found.history[np.argmax(found.history[:, 1]), 0]
        rows.append(
            (
                name.replace("_", " "),
                " ".join(map(str, found.thresholds)),
                found.value / best.value,
                int(needed),
            )
        )
    rows.append(("exact", " ".join(map(str, best.thresholds)), 1.0, ""))
    place.set(
        xscale="log",
        yscale="log",
        xlabel="evaluations",
        ylabel="share below the optimum, + 1e-7",
        xlim=(30, None),
    )
    place.set_title("the search", fontsize=LETTERS)
    made.legend(
        *place.get_legend_handles_labels(),
        loc="outside lower center",
        ncols=3,
        fontsize=LETTERS - 1,
        frameon=False,
    )
    box = np.where(mask, np.digitize(levels, thresholds, right=True), np.nan)
    show_map(axes[0, 2], box, "classes by these thresholds")
    header = ("search", "thresholds", "objective / optimum", "evaluations until then")
    text = (
        f"{subject.name}: one search with each optimiser on the histogram of the "
        "smallest channel. Tables 4.1 to 4.4 repeat the runs."
    )
    return ItemContent((ItemTable(header, tuple(rows)),), (made,), text)


def _histogram(place: Axes, levels: np.ndarray, thresholds: np.ndarray) -> None:
    counts = np.bincount(levels, minlength=_LEVELS + 1)
    place.fill_between(np.arange(_LEVELS + 1), counts / counts.sum(), step="mid", color="0.7")
    for number, threshold in enumerate(thresholds):
        place.axvline(
            threshold, color=OKABE_ITO[1], linewidth=1, label="thresholds" if number == 0 else None
        )
    place.set(
        xlabel="level of the smallest channel",
        ylabel="share of the object",
        xlim=(0, _LEVELS),
        yscale="log",
    )
    place.set_title("histogram and thresholds", fontsize=LETTERS)
    legend(place, "upper right")


def _thresholds(
    image: np.ndarray, mask: np.ndarray, options: ChaoticSegmentationOptions, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the smallest channel in quantised levels (H, W) and the thresholds of the search."""
    low = smallest(image)
    levels = quantise(low, float(low.max()))
    found = maximise(
        options.optimiser,
        OtsuObjective.of(levels[mask]),
        options.levels,
        evaluations=options.evaluations,
        seed=seed,
    )
    return levels, found.thresholds


def _sparse(context: Context) -> ItemContent:
    """Figure 3.9: the stages of Sparse Coding."""
    subject = _subject(context)
    image, mask = _inside(subject)
    gain = exposure(image, mask)
    s = stages(image.astype(float), mask, mask)
    split = separate("sparse_coding", image, mask)
    unit = float(s.brightness[mask].max())
    groups = np.where(s.group >= 0, 4 + (s.group * 7919) % 7, 0).astype(float)
    shown = [
        Panel("photo", image, mask, gain=gain),
        Panel("specular-free, SF1", fixed_chromaticity(image), mask),
        Panel("specular-free, SF2", two_band(image), mask),
        Panel("across the highlight atom: alpha", s.alpha / unit, mask),
        Panel("along it: t", s.brightness / unit, mask),
        Panel("code of each pixel alone: beta", s.beta / unit, mask),
        Panel("groups that switch the atom on", groups, mask, (0, 10), bar=False),
        Panel(
            "code that the groups keep",
            s.code / unit,
            mask,
            (0, max(float((s.beta[mask] / unit).max()), 1e-9)),
        ),
        Panel("diffuse", split.diffuse, mask, gain=gain),
        Panel("specular", split.specular, mask, gain=gain),
    ]
    active = s.group >= 0
    kept = float(s.code.sum() / max(float(s.beta[active].sum()), 1e-12))
    rows = (
        ("pixels with a code (%)", 100 * float(active[mask].mean())),
        ("groups", len(np.unique(s.group[active]))),
        ("share of their code that is kept (%)", 100 * kept),
        ("diffuse error / doing nothing", *_left(subject, split.diffuse)),
    )
    text = (
        f"{subject.name}. Each hue has a diffuse atom; the white in excess of that atom "
        "is the code of the highlight, if its group of pixels looks like a highlight. "
        "Groups have arbitrary colours; pixels without a group are darkest."
    )
    return ItemContent((ItemTable(("measure", "value"), rows),), (panel_figure(shown, 5),), text)


def _mbp(context: Context) -> ItemContent:
    """3.10: SIRFS first, then separation of its reflectance."""
    subject = _subject(context)
    plain, d = (
        decompose_subject(context, subject, "sirfs"),
        decompose_subject(context, subject, "mbp"),
    )
    gain, albedo_gain = exposure(d.image, d.mask), exposure(plain.reflectance, d.mask)
    again = split_reflectance(
        plain.image, plain.shading, plain.mask, subject_as_photo(subject).clipped, "isc"
    )
    shown = [
        Panel("photo", plain.image, plain.mask, gain=gain),
        normals_panel("1. SIRFS: normals", plain.normal, plain.mask),
        light_panel("1. SIRFS: light", plain.illumination),
        Panel("1. SIRFS: shading", plain.shading, plain.mask),
        Panel(
            "1. SIRFS: reflectance, highlights in it",
            plain.reflectance,
            plain.mask,
            gain=albedo_gain,
        ),
        Panel("2. separated: reflectance", d.reflectance, d.mask, gain=albedo_gain),
        Panel("2. separated: diffuse", d.diffuse, d.mask, gain=gain),
        Panel("2. separated: specular", d.specular, d.mask, gain=gain),
    ]
    shown += _lobe_panel(d, "3. Blinn-Phong lobe", gain)
    same = float(np.abs(again.diffuse - d.diffuse)[d.mask].max() / d.image.max())
    rows = (
        ("specular light (%)", _specular_share(d)),
        ("largest difference, stage 2 run by itself", same),
        *_lobe_rows(d),
    )
    text = (
        f"{subject.name}: SIRFS explains the photo including its highlights; they "
        "appear as pale spots of reflectance on evenly lit surfaces and are removed "
        f"there.{_lobe_words(d)}"
    )
    return ItemContent((ItemTable(("measure", "value"), rows),), (panel_figure(shown, 5),), text)


def _mdr(context: Context) -> ItemContent:
    """Figure 3.11: separation first, then SIRFS on the diffuse image."""
    subject = _subject(context)
    d = decompose_subject(context, subject)
    gain = exposure(d.image, d.mask)
    alone = separate("isc", d.image, d.mask, subject_as_photo(subject).clipped)
    shown = [
        Panel("photo", d.image, d.mask, gain=gain),
        Panel("1. separated: diffuse", d.diffuse, d.mask, gain=gain),
        Panel("1. separated: specular", d.specular, d.mask, gain=gain),
        Panel("1. confidence", alone.confidence, d.mask, (0, 1)),
        Panel("2. SIRFS: height (pixels)", d.height, d.mask),
        normals_panel("2. SIRFS: normals", d.normal, d.mask),
        light_panel("2. SIRFS: light", d.illumination),
        Panel("2. SIRFS: shading", d.shading, d.mask),
        Panel("2. SIRFS: reflectance", d.reflectance, d.mask),
    ]
    shown += _lobe_panel(d, "3. GGX lobe", gain)
    same = float(np.abs(alone.diffuse - d.diffuse)[d.mask].max() / d.image.max())
    rows = (
        ("specular light (%)", _specular_share(d)),
        ("largest difference, stage 1 run by itself", same),
        *_lobe_rows(d),
    )
    text = (
        f"{subject.name}: highlights are removed from the photo; shape, light and "
        f"reflectance are those of the diffuse image.{_lobe_words(d)}"
    )
    return ItemContent((ItemTable(("measure", "value"), rows),), (panel_figure(shown, 5),), text)


def _lobe_panel(d: Decomposition, title: str, gain: float) -> list[Panel]:
    return (
        []
        if d.brdf is None or not d.brdf.predicted.any()
        else [Panel(f"{title}: its highlights", d.brdf.predicted, d.mask, gain=gain)]
    )


def _lobe_rows(d: Decomposition) -> tuple[tuple[str, str | float], ...]:
    if d.brdf is None:
        return (("lobe", "none was fitted"),)
    alpha = "" if d.brdf.alpha is None else f"alpha {d.brdf.alpha:.2f}, "
    state = "determined" if d.brdf.determined else outcome_text(d.brdf.outcome)
    return (
        ("lobe", f"{alpha}{state}"),
        ("share of the specular layer that it explains", d.brdf.explained),
    )


def _lobe_words(d: Decomposition) -> str:
    """Return a sentence if the fitted lobe explains little of the specular layer; else nothing."""
    if d.brdf is None or d.brdf.explained >= _LEAST_EXPLAINED:
        return ""
    if not d.brdf.predicted.any():
        return f" No lobe was fitted ({outcome_text(d.brdf.outcome)})."
    if d.brdf.determined:
        return (
            " The fitted lobe explains little of the specular layer: with the estimated "
            "shape, its highlight is elsewhere."
        )
    return (
        f" The fitted lobe explains little of the specular layer ({outcome_text(d.brdf.outcome)})."
    )


def _specular_share(d: Decomposition) -> float:
    return 100 * float(d.specular[d.mask].sum(dtype=float) / d.image[d.mask].sum(dtype=float))


def _inside(subject: Subject) -> tuple[np.ndarray, np.ndarray]:
    """Return the image, 0 outside the mask, and the mask."""
    return np.where(subject.mask[..., None], subject.image, 0).astype(np.float32), subject.mask


def _left(subject: Subject, diffuse: np.ndarray) -> tuple[float | str]:
    """Return the squared error relative to that of the photo itself, if the truth is known."""
    if subject.diffuse is None:
        return ("",)
    nothing = float(np.square((subject.image - subject.diffuse)[subject.mask]).sum())
    return (
        float(np.square((diffuse - subject.diffuse)[subject.mask]).sum()) / max(nothing, 1e-30),
    )


_figure = partial(ThesisItem, "figure")
ITEMS: tuple[ThesisItem, ...] = (
    ThesisItem(
        "figure",
        "3.1",
        "Diagram of the research",
        None,
        "a diagram of the course of the research, without computation",
    ),
    _figure("3.2", "The stages of the framework", _framework),
    _figure("3.3", "The stages of Chaotic Segmentation", _segmentation),
    _figure("3.4", "The threshold search of Chaotic Segmentation", _search),
    _figure("3.9", "The stages of Sparse Coding", _sparse),
    _figure("3.10", "The stages of MBP: SIRFS first, then separation", _mbp),
    _figure("3.11", "The stages of MDR: separation first, then SIRFS", _mdr),
)
