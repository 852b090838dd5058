"""The report as one page that opens without a network: style, bar chart and pictures are inside it,
and it runs no script.

Everything that comes from outside (names of scenes, options, messages) is escaped.
"""

from collections.abc import Callable, Sequence
from html import escape

from ..measurement.bootstrap import Interval
from ..measurement.figures import CHAIN, Figure
from ..measurement.slices import EVERYTHING
from ..measurement.substitution import Budget
from ..stages.models import NAME as MODELS
from ..stages.pictures import png_data
from .cases import ValidationCase
from .markdown import CHAIN_TITLE, TRUTH_TITLES, findings, verdict_line
from .model_tables import EXPLANATION, model_tables
from .outcome import ValidationOutcome, versions
from .words import percent, with_interval

_COLORS = {"diffuse": "#e08a3c", "shape": "#5b9bd5", "light": "#e3c94b", "rest": "#8d8f94"}
_LABELS = 290  # where the bars' names end, pixels
_STYLE = """
:root{color-scheme:dark}*{box-sizing:border-box}
body{margin:0 auto;max-width:1180px;padding:2rem 1.5rem 4rem;background:#141517;color:#e6e6e3;font:16px/1.5 system-ui,sans-serif}
h1{font-size:1.9rem;margin:0 0 .3rem}h2{margin:2.6rem 0 .6rem;font-size:1.35rem}h3{margin:1.6rem 0 .4rem;font-size:1.05rem}
p,li{max-width:75ch}.faint{color:#96999e}.good{color:#7fce8f}.bad{color:#ff8a70}
.verdict{font-size:1.15rem;font-weight:600}
.wide{overflow-x:auto}table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.9rem}
th,td{padding:.3rem .8rem .3rem 0;text-align:right;border-bottom:1px solid #2c2f33;white-space:nowrap}
th{color:#96999e;font-weight:500}th:first-child,td:first-child,td.word,th.word{text-align:left}
details{margin:.6rem 0}summary{cursor:pointer;color:#b9bcc1}
.case{background:#212326;border-radius:12px;padding:.9rem 1rem;margin:.8rem 0}
.case p{margin:0 0 .6rem}.maps{display:flex;flex-wrap:wrap;gap:.7rem}
figure{margin:0}figure img{display:block;width:150px;border-radius:8px;image-rendering:auto}
figcaption{font-size:.78rem;color:#96999e;max-width:150px;margin-top:.2rem}
svg text{fill:#e6e6e3;font:13px system-ui,sans-serif}svg .faint{fill:#96999e}code{color:#c9d6e2;overflow-wrap:anywhere}
"""


def page(
    outcome: ValidationOutcome, cases: Sequence[ValidationCase], evidence: Sequence[str]
) -> str:
    """The whole page. `evidence`: files kept, relative to the page."""
    parts = [_head(outcome), _budget_part(outcome.budgets)]
    stages = dict.fromkeys(f.stage for f in outcome.figures)
    parts += [
        _stage_part(stage, outcome, cases)
        for stage in sorted(stages, key=lambda stage: stage != CHAIN)
    ]
    parts += [_judged(outcome, evidence), _made(outcome)]
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>ISC validation</title><style>{_STYLE}</style>'
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n<body>\n'
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def _head(outcome: ValidationOutcome) -> str:
    style = "bad" if outcome.failures else "good"
    count = f"{len(outcome.measured)} scenes of {escape(outcome.dataset)}"
    lines = [f"<li>{escape(text)}</li>" for text in findings(outcome)]
    lines += [f'<li class="bad">{escape(text)}</li>' for text in outcome.failures]
    lines += [f'<li class="faint">{escape(text)}</li>' for text in outcome.notes]
    return (
        f'<h1>Validation against synthetic ground truth</h1><p class="faint">{count}</p>'
        f'<p class="verdict {style}">{escape(verdict_line(outcome))}</p><ul>{"".join(lines)}</ul>'
    )


def _budget_part(budgets: Sequence[Budget]) -> str:
    if not budgets:
        return ""
    heading = [
        "error",
        "of the chain",
        *TRUTH_TITLES.values(),
        "left with all truths",
        "the same, exact normals",
    ]
    heading += [f"× with true {name}" for name in TRUTH_TITLES]
    rows = []
    for found in budgets:
        shares = {share.truth: share for share in found.shares}
        cells = [percent(shares[truth].share) if truth in shares else "" for truth in TRUTH_TITLES]
        alone = [
            with_interval(shares[truth].alone) if truth in shares else "" for truth in TRUTH_TITLES
        ]
        rows.append(
            [
                found.metric.title,
                with_interval(found.error),
                *cells,
                percent(found.rest),
                percent(found.exact),
                *alone,
            ]
        )
    text = (
        "Truth is swapped in for one stage's answer at a time, alone and beside the other truths. A share is what the truth of a stage "
        "saves of the final error, averaged over the orders in which truths can be given; shares and what is left add up to all of it. "
        "A negative share says that the chain does better with that stage's error than without it. What is left with all truths no stage "
        "can remove: rendered shading is not the exponential of nine spherical harmonics of the normal. Shape and light are not scored "
        "where they are given themselves. Errors are geometric means."
    )
    return (
        f"<h2>Error budget</h2><p>{escape(text)}</p>{budget_chart(budgets)}{_table(heading, rows)}"
    )


def budget_chart(budgets: Sequence[Budget]) -> str:
    """Bars of shares, a group for each error, with whiskers for the intervals; an SVG element."""
    left, right, bar, gap = _LABELS + 10.0, 190.0, 15, 16
    width = 1000.0
    entries = [
        (found, [*((TRUTH_TITLES[s.truth], _COLORS[s.truth], s.share) for s in found.shares)])
        for found in budgets
    ]
    rows = [
        (found.metric.title, [*shares, ("left with all truths", _COLORS["rest"], found.rest)])
        for found, shares in entries
    ]
    ends = [
        end
        for _, bars in rows
        for _, _, i in bars
        for end in (i.value, i.low or i.value, i.high or i.value)
    ]
    low, high = max(min(0.0, *ends), -1.5), min(max(1.0, *ends), 2.5)

    def x(value: float) -> float:
        return left + (min(max(value, low), high) - low) / (high - low) * (width - left - right)

    parts, y = [], 10.0
    for title, bars in rows:
        parts.append(f'<text x="0" y="{y + 12:.0f}">{escape(title)}</text>')
        for name, color, interval in bars:
            parts.append(_bar(x, y, bar - 3, name, color, interval, width - right))
            y += bar
        y += gap
    axis = f'<line x1="{x(0):.1f}" x2="{x(0):.1f}" y1="4" y2="{y - gap + 4:.0f}" stroke="#96999e"/>'
    title = "Shares of the chain's error by stage, with 95 % intervals"
    box = f'viewBox="0 0 {width:.0f} {y:.0f}" width="{width:.0f}" role="img" aria-label="{title}"'
    return f'<div class="wide"><svg {box}>{"".join(parts)}{axis}</svg></div>'


def _bar(
    x: Callable[[float], float],
    y: float,
    height: float,
    name: str,
    color: str,
    interval: Interval,
    end: float,
) -> str:
    start, stop = sorted((x(0.0), x(interval.value)))
    drawn = f'<rect x="{start:.1f}" y="{y:.1f}" width="{max(stop - start, 1):.1f}" height="{height}" rx="2" fill="{color}"/>'
    if interval.low is not None and interval.high is not None:
        middle = y + height / 2
        drawn += f'<line x1="{x(interval.low):.1f}" x2="{x(interval.high):.1f}" y1="{middle}" y2="{middle}" stroke="#fff" stroke-width="1.5"/>'
    text = f'<text x="{_LABELS}" y="{y + height - 2:.0f}" text-anchor="end" class="faint">{escape(name)}</text>'
    return (
        drawn
        + text
        + f'<text x="{end + 14:.0f}" y="{y + height - 2:.0f}">{escape(percent(interval))}</text>'
    )


def _stage_part(stage: str, outcome: ValidationOutcome, cases: Sequence[ValidationCase]) -> str:
    figures = [f for f in outcome.figures if f.stage == stage]
    title = (
        CHAIN_TITLE
        if stage == CHAIN
        else next(found.title for found in outcome.options.stages if found.name == stage)
    )
    if stage == MODELS:
        return f"<h2>{escape(title)}</h2>" + _model_part(outcome) + _cases(stage, cases)
    whole = [f for f in figures if f.group.kind == EVERYTHING]
    rows = [
        [f.metric.title, with_interval(f.interval), f.metric.unit, _mean(f), str(f.interval.scenes)]
        for f in whole
    ]
    parts = [
        f"<h2>{escape(title)}</h2>",
        _table(["figure", "mean [95 % interval]", "unit", "mean over scenes", "scenes"], rows),
    ]
    names = [f.metric.title for f in whole]
    for kind in dict.fromkeys(f.group.kind for f in figures if f.group.kind != EVERYTHING):
        body = []
        for value in dict.fromkeys(f.group.value for f in figures if f.group.kind == kind):
            own = {
                f.metric.title: f
                for f in figures
                if f.group.kind == kind and f.group.value == value
            }
            members = next(iter(own.values())).group.members
            body.append(
                [
                    value,
                    str(len(members)),
                    *(with_interval(own[name].interval) if name in own else "" for name in names),
                ]
            )
        parts.append(
            f"<details><summary>by {escape(kind)}</summary>{_table([kind, 'scenes', *names], body)}</details>"
        )
    return "".join(parts) + _cases(stage, cases)


def _model_part(outcome: ValidationOutcome) -> str:
    parts = [f"<p>{escape(EXPLANATION)}</p>"]
    for table in model_tables(outcome):
        text = _table(table.heading, table.rows, words=table.heading.index("model") + 1)
        parts.append(
            text
            if table.kind == EVERYTHING
            else f"<details><summary>by {escape(table.kind)}</summary>{text}</details>"
        )
    return "".join(parts)


def _cases(stage: str, cases: Sequence[ValidationCase]) -> str:
    return "".join(_case(case) for case in cases if case.stage == stage)


def _mean(figure: Figure) -> str:
    return "geometric" if figure.metric.geometric else "arithmetic"


def _case(case: ValidationCase) -> str:
    pictures = "".join(
        f'<figure><img alt="{escape(p.caption)}" src="{png_data(p.colors)}"><figcaption>{escape(p.caption)}</figcaption></figure>'
        for p in case.pictures
    )
    title = f"<b>{escape(case.rank)}</b> · {escape(case.scene)} · <span class=faint>{escape(case.remark)}</span>"
    return f'<div class="case"><p>{title}</p><div class="maps">{pictures}</div></div>'


def _judged(outcome: ValidationOutcome, evidence: Sequence[str]) -> str:
    if not (outcome.verdicts or outcome.checks):
        return ""
    rows = [
        ["broken" if v.broken else "kept", v.text]
        for v in sorted(outcome.verdicts, key=lambda v: not v.broken)
    ]
    rows += [["passed" if c.passed else "failed", c.text] for c in outcome.checks]
    kept = (
        f"<p>Kept as evidence: {', '.join(f'<code>{escape(name)}</code>' for name in evidence)}.</p>"
        if evidence
        else ""
    )
    note = "A bound is broken only where the whole interval lies beyond it; slices of fewer than five scenes are not judged."
    table = _table(["verdict", "what"], rows, words=2)
    return f"<h2>Bounds and checks</h2><p>{note}</p>{kept}<details><summary>all {len(rows)}</summary>{table}</details>"


def _made(outcome: ValidationOutcome) -> str:
    options = outcome.options
    facts = [
        f"separator {options.settings.separator}",
        f"illumination {options.settings.illumination}",
        f"seed {options.seed}",
    ]
    facts += [f"{name} {version}" for name, version in versions().items()]
    return f"<h2>How it was made</h2><p><code>{escape(outcome.command)}</code></p><p class=faint>{escape(', '.join(facts))}</p>"


def _table(heading: Sequence[str], rows: Sequence[Sequence[str]], words: int = 1) -> str:
    def line(tag: str, cells: Sequence[str]) -> str:
        kinds = ((' class="word"' if k < words else "") for k in range(len(cells)))
        return (
            "<tr>"
            + "".join(
                f"<{tag}{kind}>{escape(cell)}</{tag}>"
                for kind, cell in zip(kinds, cells, strict=True)
            )
            + "</tr>"
        )

    return f'<div class="wide"><table>{line("th", heading)}{"".join(line("td", row) for row in rows)}</table></div>'
