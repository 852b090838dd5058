"""The term of the expected shading, with the formula of `shading_term`.

Its gradient with respect to the log shading is added to that of the palette terms, which
`height_rows.backward_rows` propagates to normals and light; it is therefore transformed to their
whitened space. Rows are independent of each other, and their sums are added in the order of the
rows.
"""

# mypy: disable-error-code="no-untyped-def"
# (the compiler infers the types of every call)

from ...numerics.jit import REASSOCIATED, jit


@jit(types="i8 i8 r[3] i8[2] r[2] r[3] r[2] r[3] f8[2]", math=REASSOCIATED)
def residual_rows(first, last, geometry, spans, light, mean, strength, residual, sums):
    """Compute the log shading minus the expected one in rows [first, last).

    Parameters
    ----------
    first, last : int
        Rows of this call.
    geometry : (H, 9, W) ndarray
        See `arrays.Surface`.
    spans : (H, 2) int64 ndarray
        See `arrays.Photo`.
    light : (9, C) ndarray
        As in `height_rows.forward_rows`.
    mean : (H, C, W) ndarray
        Expected log shading.
    strength : (H, W) ndarray
        See `precision.scaled_precision`.
    residual : (H, C, W) ndarray
        Output, written within the spans.
    sums : (H, C) float64 ndarray
        Output: sum over each row of strength times residual.
    """
    t = geometry.dtype.type
    for i in range(first, last):
        a, b = spans[i, 0], spans[i, 1]
        n1, n2, n3 = geometry[i, 5, a:b], geometry[i, 6, a:b], geometry[i, 7, a:b]
        s = strength[i, a:b]
        for c in range(mean.shape[1]):
            l0, l1, l2, l3, l4 = light[0, c], light[1, c], light[2, c], light[3, c], light[4, c]
            l5, l6, l7, l8 = light[5, c], light[6, c], light[7, c], light[8, c]
            m, out = mean[i, c, a:b], residual[i, c, a:b]
            for j in range(b - a):
                out[j] = (
                    l0
                    + n1[j] * (l3 + l4 * n2[j] + l7 * n3[j] + l8 * n1[j])
                    + n2[j] * (l1 + l5 * n3[j] - l8 * n2[j])
                    + n3[j] * (l2 + l6 * n3[j])
                ) - m[j]
            total = t(0)
            for j in range(b - a):
                total += s[j] * out[j]
            sums[i, c] = total


@jit(types="i8 i8 i8[2] r[3] r[1] r[2] r[2] r[3] r[3] f8[1]", math=REASSOCIATED)
def pull_rows(first, last, spans, residual, offsets, strength, back, palette, joined, sums):
    """Compute the term and its gradient in rows [first, last).

    Parameters
    ----------
    first, last : int
        Rows of this call.
    spans : (H, 2) int64 ndarray
        See `arrays.Photo`.
    residual : (H, C, W) ndarray
        From `residual_rows`; overwritten by the gradient with respect to the log shading.
    offsets : (C,) ndarray
        The free constants.
    strength : (H, W) ndarray
        See `precision.scaled_precision`.
    back : (C, C) ndarray
        Transforms that gradient to the whitened space of the palette terms.
    palette : (H, C, W) ndarray
        Gradient of the palette terms with respect to the whitened log reflectances.
    joined : (H, C, W) ndarray
        Output: both gradients in that space, written within the spans.
    sums : (H,) float64 ndarray
        Output: the term of each row.
    """
    t = residual.dtype.type
    half = t(0.5)
    channels = residual.shape[1]
    for i in range(first, last):
        a, b = spans[i, 0], spans[i, 1]
        s = strength[i, a:b]
        total = t(0)
        for c in range(channels):
            r, k = residual[i, c, a:b], offsets[c]
            for j in range(b - a):
                away = r[j] - k
                r[j] = s[j] * away
                total += r[j] * away
        sums[i] = half * total
        for c in range(channels):
            source, out = palette[i, c, a:b], joined[i, c, a:b]
            for j in range(b - a):
                out[j] = source[j]
            for d in range(channels):
                factor, r = back[c, d], residual[i, d, a:b]
                for j in range(b - a):
                    out[j] += factor * r[j]
