"""MIT-Berkeley's objects with strong highlights: the set's own shapes, reflectances and lights with
a rendered specular layer.

Problem: highlights of the photographed set are weak, and its natural images have none; methods that
separate highlights need a set with strong ones, and ground truth of every layer.

Equation: diffuse = reflectance * exp(SH(normal)), with the set's own three; specular = strength *
gloss(normal, environment), a rendered Blinn-Phong lobe under a non-negative environment fitted to
exp(SH); image = diffuse + specular. One panel may be added to both layers. The strength is chosen
so that the specular layer has a given share of the light inside the mask.

Citation: R. Grosse, M. K. Johnson, E. H. Adelson, W. T. Freeman (2009),
doi:10.1109/ICCV.2009.5459428, and J. T. Barron, J. Malik (2015), doi:10.1109/TPAMI.2014.2377712
(the set); J. F. Blinn (1977), doi:10.1145/563858.563893 (the lobe).

Limits: no shadows and no interreflections (shadows in the physical variant only); the environment
behind the object is unconstrained. The output derives from research data and remains under the
terms of that data.
"""
