"""The terms of expected normals, from the silhouette or a prediction."""

# mypy: disable-error-code="no-untyped-def"
# (the compiler infers the types of every call)

from ...numerics.jit import REASSOCIATED, jit


@jit(types="i8 i8 r[3] r[3] r[2] r[3] f8[1]", math=REASSOCIATED)
def normals_rows(first, last, geometry, expected, strength, gradient, sums):
    """Compute a term of expected normals in rows [first, last).

    Parameters
    ----------
    first, last : int
        Rows of this call.
    geometry : (H, 9, W) ndarray
        See `arrays.Surface`.
    expected : (2, H, W) ndarray
        Expected n1 and n2.
    strength : (H, W) ndarray
        See `precision.scaled_precision`.
    gradient : (2, H, W) ndarray
        Gradients with respect to n1 and n2; those of this term are added.
    sums : (H,) ndarray
        Output: the term of each row.
    """
    t = geometry.dtype.type
    half = t(0.5)
    for i in range(first, last):
        n1, n2, m1, m2, s = (
            geometry[i, 5],
            geometry[i, 6],
            expected[0, i],
            expected[1, i],
            strength[i],
        )
        g1, g2 = gradient[0, i], gradient[1, i]
        for j in range(len(s)):
            g1[j] += s[j] * (n1[j] - m1[j])
        for j in range(len(s)):
            g2[j] += s[j] * (n2[j] - m2[j])
        total = t(0)
        for j in range(len(s)):
            away1, away2 = n1[j] - m1[j], n2[j] - m2[j]
            total += s[j] * (away1 * away1 + away2 * away2)
        sums[i] = half * total
