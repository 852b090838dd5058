"""Forward and backward pass between the height and the terms of the objective, by rows.

`forward_rows` computes geometry and whitened log reflectance, `backward_rows` the gradients with
respect to the derivatives of the height and to the light, `adjoint_rows` that with respect to the
height.
"""

# mypy: disable-error-code="no-untyped-def"
# (the compiler infers the types of every call)

from typing import NamedTuple

import numpy as np

from ...numerics.jit import IN_ORDER, REASSOCIATED, jit
from . import arrays


class Pulls(NamedTuple):
    """Gradients that `backward_rows` propagates to the height and the light; unscaled.

    Attributes
    ----------
    smoothness, palette : (H, C, W) ndarray
        With respect to the whitened log reflectances.
    curvature : (H, W) ndarray
        With respect to the mean curvature.
    """

    smoothness: np.ndarray
    palette: np.ndarray
    curvature: np.ndarray


class Backward(NamedTuple):
    """Output of `backward_rows`.

    Attributes
    ----------
    light : (H, 9, C) ndarray
        Gradient with respect to the light of each row, as sums over monomials of the normal.
    derivatives : (5, H + 4, W + 4) ndarray
        Gradient with respect to zi, zj, zii, zjj and zij, with a zero border of two pixels; the
        last three are zero outside the spans.
    """

    light: np.ndarray
    derivatives: np.ndarray


@jit(
    types=f"i8 i8 f8[2] {arrays.PHOTO} r[2] arrays.Reflectance(r[2] r[2]) {arrays.SURFACE} "
    "arrays.Reflectance(r[3] r[3])",
    math=IN_ORDER,
)
def forward_rows(first, last, padded, photo, light, whiten, surface, reflectance):
    """Compute the geometry, the whitened log reflectance and the slant term of rows [first, last).

    Differences of neighbouring heights are exact; if they were reordered, float32 would lose the
    digits that the curvature needs. Hence the mode `IN_ORDER`.

    Parameters
    ----------
    first, last : int
        Rows of this call.
    padded : (H + 2, W + 2) float64 ndarray
        Height with replicated borders, pixels.
    photo : Photo
    light : (9, C) ndarray
        Coefficients, already multiplied by the constants of the basis.
    whiten : Reflectance
        Whitening matrices.
    surface : Surface
        Output; curvature and second derivatives are written within the spans only.
    reflectance : Reflectance
        Output; whitened log reflectances, written within the spans only.
    """
    log_image, spans = photo.log_image, photo.spans
    geometry = surface.geometry
    t = geometry.dtype.type
    one, two, half = t(1), t(2), t(0.5)
    channels, width = log_image.shape[1], log_image.shape[2]
    soft = t(1e-4)
    a = np.empty((channels, width), geometry.dtype)
    for i in range(first, last):
        up, mid, low = padded[i], padded[i + 1], padded[i + 2]
        row = geometry[i]
        zi, zj, n1, n2, n3 = row[0], row[1], row[5], row[6], row[7]
        for j in range(width):
            zi[j] = (
                (low[j] - up[j]) + 2.0 * (low[j + 1] - up[j + 1]) + (low[j + 2] - up[j + 2])
            ) * 0.125
        for j in range(width):
            zj[j] = (
                (up[j + 2] - up[j]) + 2.0 * (mid[j + 2] - mid[j]) + (low[j + 2] - low[j])
            ) * 0.125
        for j in range(width):
            n3[j] = one / np.sqrt(one + zi[j] * zi[j] + zj[j] * zj[j])
        for j in range(width):
            n1[j] = -zi[j] * n3[j]
        for j in range(width):
            n2[j] = -zj[j] * n3[j]
        total = t(0)
        dslant = surface.slant_gradient[i]
        for j in range(width):
            x = -np.log(n3[j])
            root = np.sqrt(x * x + soft)
            total += root
            dslant[j] = -x / (root * n3[j])
        surface.slant[i] = total
        start, stop = spans[i, 0], spans[i, 1]
        count = stop - start
        if count <= 0:
            continue
        end = stop + 2
        up, mid, low = padded[i, start:end], padded[i + 1, start:end], padded[i + 2, start:end]
        zi, zj, zii = row[0, start:stop], row[1, start:stop], row[2, start:stop]
        zjj, zij, n1 = row[3, start:stop], row[4, start:stop], row[5, start:stop]
        n2, n3, k = row[6, start:stop], row[7, start:stop], row[8, start:stop]
        for j in range(count):
            left = (up[j] - mid[j]) + (low[j] - mid[j])
            centre = (up[j + 1] - mid[j + 1]) + (low[j + 1] - mid[j + 1])
            zii[j] = (
                left + 2.0 * centre + ((up[j + 2] - mid[j + 2]) + (low[j + 2] - mid[j + 2]))
            ) * 0.25
        for j in range(count):
            top = (up[j] - up[j + 1]) + (up[j + 2] - up[j + 1])
            centre = (mid[j] - mid[j + 1]) + (mid[j + 2] - mid[j + 1])
            zjj[j] = (
                top + 2.0 * centre + ((low[j] - low[j + 1]) + (low[j + 2] - low[j + 1]))
            ) * 0.25
        for j in range(count):
            zij[j] = ((low[j + 2] - low[j]) - (up[j + 2] - up[j])) * 0.25
        for j in range(count):
            k[j] = (
                (
                    (one + zi[j] * zi[j]) * zjj[j]
                    - two * zi[j] * zj[j] * zij[j]
                    + (one + zj[j] * zj[j]) * zii[j]
                )
                * (n3[j] * n3[j] * n3[j])
                * half
            )
        for c in range(channels):
            l0, l1, l2, l3, l4 = light[0, c], light[1, c], light[2, c], light[3, c], light[4, c]
            l5, l6, l7, l8 = light[5, c], light[6, c], light[7, c], light[8, c]
            ac, image = a[c], log_image[i, c, start:stop]
            for j in range(count):
                ac[j] = image[j] - (
                    l0
                    + n1[j] * (l3 + l4 * n2[j] + l7 * n3[j] + l8 * n1[j])
                    + n2[j] * (l1 + l5 * n3[j] - l8 * n2[j])
                    + n3[j] * (l2 + l6 * n3[j])
                )
        _mix(a[:, :count], whiten.smoothness, reflectance.smoothness[i, :, start:stop])
        _mix(a[:, :count], whiten.palette, reflectance.palette[i, :, start:stop])


@jit(math=REASSOCIATED, inline=True)
def _mix(source, matrix, target):
    """Write target[c] = sum_d matrix[c, d] source[d], row by row."""
    width = source.shape[1]
    if source.shape[0] == 1:
        for j in range(width):
            target[0, j] = matrix[0, 0] * source[0, j]
        return
    s0, s1, s2 = source[0], source[1], source[2]
    for c in range(3):
        m0, m1, m2 = matrix[c, 0], matrix[c, 1], matrix[c, 2]
        out = target[c]
        for j in range(width):
            out[j] = m0 * s0[j] + m1 * s1[j] + m2 * s2[j]


@jit(
    types=f"i8 i8 {arrays.SURFACE} i8[2] r[2] arrays.Reflectance(r[2] r[2]) "
    "Pulls(r[3] r[3] r[2]) (f8 f8 f8 f8) r[3] Backward(f8[3] r[3])",
    math=REASSOCIATED,
)
def backward_rows(first, last, surface, spans, light, whiten, pulls, scales, in_plane, out):
    """Compute the gradients with respect to the height's derivatives and the light.

    Parameters
    ----------
    first, last : int
        Rows of this call.
    surface : Surface
    spans : (H, 2) int64 ndarray
        See `arrays.Photo`.
    light : (9, C) ndarray
        As in `forward_rows`.
    whiten : Reflectance
        Whitening matrices.
    pulls : Pulls
        Gradients with respect to the whitened log reflectances and the curvature.
    scales : tuple of float
        Factors of the smoothness, palette, curvature and slant gradients.
    in_plane : (2, H, W) ndarray
        Gradients of the terms of contour and expected normals with respect to n1 and n2.
    out : Backward
        Output.
    """
    geometry, light_sums = surface.geometry, out.light
    g_smooth, g_palette, g_curvature = pulls.smoothness, pulls.palette, pulls.curvature
    t = geometry.dtype.type
    two, three = t(2), t(3)
    channels, width = g_smooth.shape[1], g_smooth.shape[2]
    k_smooth, k_palette = t(scales[0]), t(scales[1])
    k_curvature, k_slant = t(scales[2]), t(scales[3])
    m_smooth, m_palette = whiten.smoothness.T * k_smooth, whiten.palette.T * k_palette
    shape = (channels, width)
    e_all, f_all = np.empty(shape, geometry.dtype), np.empty(shape, geometry.dtype)
    d1_all, d2_all, dn3_all = (
        np.empty(width, geometry.dtype),
        np.empty(width, geometry.dtype),
        np.empty(width, geometry.dtype),
    )
    along_all, dk_all = np.empty(width, geometry.dtype), np.empty(width, geometry.dtype)
    for i in range(first, last):
        row = geometry[i]
        start, stop = spans[i, 0], spans[i, 1]
        count = stop - start
        c1, c2, slant = in_plane[0, i], in_plane[1, i], surface.slant_gradient[i]
        for j in range(width):
            d1_all[j] = c1[j]
        for j in range(width):
            d2_all[j] = c2[j]
        for j in range(width):
            dn3_all[j] = slant[j] * k_slant
        if count > 0:
            n1, n2, n3 = row[5, start:stop], row[6, start:stop], row[7, start:stop]
            d1, d2, dn3 = d1_all[start:stop], d2_all[start:stop], dn3_all[start:stop]
            e, f = e_all[:, :count], f_all[:, :count]
            _mix(g_smooth[i, :, start:stop], m_smooth, e)
            _mix(g_palette[i, :, start:stop], m_palette, f)
            for c in range(channels):
                ec, fc = e[c], f[c]
                for j in range(count):
                    ec[j] = -(ec[j] + fc[j])  # gradient of the log shading
                _light_sums(ec, n1, n2, n3, light_sums[i, :, c])
                l1, l2, l3, l4 = light[1, c], light[2, c], light[3, c], light[4, c]
                l5, l6, l7, l8 = light[5, c], light[6, c], light[7, c], light[8, c]
                for j in range(count):
                    d1[j] += ec[j] * (l3 + l4 * n2[j] + l7 * n3[j] + two * l8 * n1[j])
                for j in range(count):
                    d2[j] += ec[j] * (l1 + l4 * n1[j] + l5 * n3[j] - two * l8 * n2[j])
                for j in range(count):
                    dn3[j] += ec[j] * (l2 + l5 * n2[j] + l7 * n1[j] + two * l6 * n3[j])
        else:
            light_sums[i] = 0.0
        zi, zj, n3 = row[0], row[1], row[7]
        for j in range(width):
            along_all[j] = zi[j] * d1_all[j] + zj[j] * d2_all[j] - dn3_all[j]
        for j in range(width):
            along_all[j] = along_all[j] * n3[j] * n3[j] * n3[j]
        if count > 0:
            gk, curved, n3 = g_curvature[i, start:stop], row[8, start:stop], row[7, start:stop]
            dk, along = dk_all[:count], along_all[start:stop]
            for j in range(count):
                dk[j] = gk[j] * k_curvature
            for j in range(count):
                along[j] -= three * curved[j] * n3[j] * n3[j] * dk[j]
            for j in range(count):
                dk[j] = dk[j] * n3[j] * n3[j] * n3[j]
        n3 = row[7]
        down = out.derivatives[0, i + 2, 2 : width + 2]
        right = out.derivatives[1, i + 2, 2 : width + 2]
        for j in range(width):
            down[j] = zi[j] * along_all[j] - n3[j] * d1_all[j]
        for j in range(width):
            right[j] = zj[j] * along_all[j] - n3[j] * d2_all[j]
        if count > 0:
            _curvature_derivatives(
                row[:, start:stop],
                dk_all[:count],
                out.derivatives[:, i + 2, start + 2 : stop + 2],
            )


@jit(math=REASSOCIATED, inline=True)
def _curvature_derivatives(row, dk, out):
    """Add the gradient of the curvature, dk (W,) times n3^3, to those of the derivatives.

    `out` is (5, W); its last three rows are overwritten.
    """
    t = row.dtype.type
    one, half = t(1), t(0.5)
    zi, zj, zii, zjj, zij = row[0], row[1], row[2], row[3], row[4]
    count = len(dk)
    cross = np.empty(count, row.dtype)
    for j in range(count):
        cross[j] = dk[j] * (zi[j] * zjj[j] - zj[j] * zij[j])
    o = out[0]
    for j in range(count):
        o[j] += cross[j]
    for j in range(count):
        cross[j] = dk[j] * (zj[j] * zii[j] - zi[j] * zij[j])
    o = out[1]
    for j in range(count):
        o[j] += cross[j]
    o = out[2]
    for j in range(count):
        o[j] = half * dk[j] * (one + zj[j] * zj[j])
    o = out[3]
    for j in range(count):
        o[j] = half * dk[j] * (one + zi[j] * zi[j])
    o = out[4]
    for j in range(count):
        o[j] = -dk[j] * zi[j] * zj[j]


@jit(math=REASSOCIATED, inline=True)
def _light_sums(d, n1, n2, n3, sums):
    """Write the sums of d times 1, n2, n3, n1, n1 n2, n2 n3, n3^2, n1 n3, n1^2 - n2^2."""
    t = d.dtype.type
    s0, s1, s2, s3, s4, s5, s6, s7, s8 = t(0), t(0), t(0), t(0), t(0), t(0), t(0), t(0), t(0)
    for j in range(len(d)):
        a, b, c = d[j] * n1[j], d[j] * n2[j], d[j] * n3[j]
        s0 += d[j]
        s1 += b
        s2 += c
        s3 += a
        s4 += a * n2[j]
        s5 += b * n3[j]
        s6 += c * n3[j]
        s7 += a * n3[j]
        s8 += a * n1[j] - b * n2[j]
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[7], sums[8] = (
        s0,
        s1,
        s2,
        s3,
        s4,
        s5,
        s6,
        s7,
        s8,
    )


@jit(types="i8 i8 r[3] r[2]", math=REASSOCIATED)
def adjoint_rows(first, last, d, wide):
    """Compute rows [first, last) of the gradient of the padded height.

    Parameters
    ----------
    first, last : int
        Rows of this call.
    d : (5, H + 4, W + 4) ndarray
        Gradients of the five derivatives, with a zero border.
    wide : (H + 2, W + 2) ndarray
        Output.
    """
    t = wide.dtype.type
    two, quarter, eighth = t(2), t(0.25), t(0.125)
    width = d.shape[2]
    p = np.empty(width, wide.dtype)
    q = np.empty(width, wide.dtype)
    r = np.empty(width, wide.dtype)
    for i in range(first, last):
        below, here, above = (
            d[:, i],
            d[:, i + 1],
            d[:, i + 2],
        )  # sources whose stencil has this row below, at, above its centre
        b0, b1, b2, b3, b4 = below[0], below[1], below[2], below[3], below[4]
        h1, h2, h3 = here[1], here[2], here[3]
        a0, a1, a2, a3, a4 = above[0], above[1], above[2], above[3], above[4]
        for j in range(width):
            p[j] = (b0[j] - a0[j]) * eighth + (b2[j] - two * h2[j] + a2[j]) * quarter
        for j in range(width):
            q[j] = (b1[j] + two * h1[j] + a1[j]) * eighth + (b4[j] - a4[j]) * quarter
        for j in range(width):
            r[j] = (b3[j] + two * h3[j] + a3[j]) * quarter
        out = wide[i]
        for j in range(width - 2):
            out[j] = (
                p[j]
                + two * p[j + 1]
                + p[j + 2]
                + q[j]
                - q[j + 2]
                + r[j]
                - two * r[j + 1]
                + r[j + 2]
            )
