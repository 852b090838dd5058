"""Refinement of a decomposition by rendering: a light whose shadows are cast by the recovered
shape.

Problem: the light of SIRFS is a smooth function of the normal and casts no shadows.

Equation: with the shape fixed, the light of each point is linear in the environment,

    S_p = sum_j T_pj E_j + I_p,    T_pj = V_pj max(0, n_p . w_j) omega_j / pi,

E_j > 0 the radiance of pixel j of an environment map, w_j its direction, omega_j its solid angle, I
the light that the surface itself reflects, which the photo shows. Mitsuba traces V and I once
(`transport`); all else are products with T, exact in value and gradient. log E is changed by smooth
bumps u and a colour c (`light_field`) to

    min over u, c of  g(log D - log S) + r / 2 (|u|^2 + |c|^2),

g the reflectance terms of SIRFS, D the diffuse image (`light_objective`). A tenth of the pixels, in
blocks, is held out; the new light is kept only if the objective falls and it explains these blocks
better (`held_out`).

Citation: J. T. Barron, J. Malik 2015, doi:10.1109/TPAMI.2014.2377712 (g); P.-P. Sloan, J. Kautz, J.
Snyder 2002, doi:10.1145/566654.566612 (precomputed transport).

Limits: measured in docs/methods/refine.md. The shape, the layers and the lobe are fixed; light from
parts of the object that the photo does not show is missing; an environment of 32 x 16 pixels blurs
lamps.
"""
