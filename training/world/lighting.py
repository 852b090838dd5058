"""Pictures of stored views under any light, in milliseconds.

Problem: learning needs millions of pictures, each in another light and another paint. Rays are the
expensive part; `training.world.views` has traced them.

Equation: with the visible directions l_k of a view, its visibility V_k, the radiance E_k of the
surroundings around l_k times the solid angle, and the lamps' irradiance I_j at V_j,

    S = sum_k V_k E_k max(n.l_k, 0) / pi + sum_j V_j I_j max(n.l_j, 0) o_j / pi + bounce,
    image = albedo S (1 - E) + E R occlusion + sum_j V_j I_j D G F / (4 n.v),

V_k max(n.l_k, 0) is the same in every light: it is computed once for each view and kept in 8 bits.

with D, G of a GGX lobe, D averaged over the lamp's disc, o the Oren-Nayar factor, F Schlick's, E
what the lobe reflects of uniform light (`training.world.reflectance`), and R the surroundings
smoothed as wide as the lobe, in the mirror direction. The bounce is a diffuse estimate from how
much of the hemisphere the body itself covers. A coat is a second, sharp lobe.
Light may also be given as harmonics of the log shading, as SIRFS assumes it: S = exp(Y(n) L).

Citation: B. Walter et al. 2007, doi:10.2312/EGWR/EGSR07/195-206 (GGX); C. Schlick 1994,
doi:10.1111/1467-8659.1330233 (F); M. Oren, S. K. Nayar 1994, doi:10.1145/192161.192213;
surroundings smoothed beforehand: W. Heidrich, H.-P. Seidel 1999, doi:10.1145/311535.311554.

Limits: lamps cast the shadow of the nearest stored direction; Oren-Nayar holds for lamps alone;
what mirrors see of the body itself is estimated from the hemisphere that the body covers; lobes of
mirrored surroundings do not end at the surface's horizon.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Self

import torch
from torch.nn import functional

from .reflectance import reflected_share
from .tensor_batch import TensorBatch
from .view_batches import ViewBatch
from .views import DIRECTIONS, LOWEST

_SOLID_ANGLE = 2 * math.pi * (1 - LOWEST) / DIRECTIONS
_STEEPEST = 0.02  # least cosine toward the viewer, so that grazing lobes stay finite
_DARKEST = 1e-4
_LOST = 0.195  # of a uniform sphere's light on a normal across the view comes from below the cap
_POINT = 0.02  # radians: smaller lamps shine from one stored direction
_COAT = 0.06  # roughness of a clear coat
_FLOOR = 0.03  # of the mean shading: added before the logarithm of what no light reaches
_NORMALS = 128


@dataclass(frozen=True, eq=False)
class Material(TensorBatch):
    """The surfaces of B views.

    Attributes
    ----------
    albedo : (B, P, 3) tensor
        Linear, in [0, 1].
    alpha : (B, P) tensor
        GGX roughness.
    front : (B, P, 3) tensor
        Reflectance at normal incidence, 0 without gloss; coloured for metals.
    coat : (B,) tensor
        Reflectance at normal incidence of a clear coat, 0 without.
    sigma : (B,) tensor
        Oren-Nayar roughness, radians.
    clear : (B,) tensor
        1 for glass, whose diffuse light is what is seen through it.
    """

    albedo: torch.Tensor
    alpha: torch.Tensor
    front: torch.Tensor
    coat: torch.Tensor
    sigma: torch.Tensor
    clear: torch.Tensor

    def without_diffuse(self, chosen: torch.Tensor) -> "Material":
        """Return the material without diffuse light on the chosen bodies.

        Parameters
        ----------
        chosen : (B,) bool tensor

        Returns
        -------
        Material
        """
        return replace(self, albedo=self.albedo * (~chosen)[:, None, None])


@dataclass(frozen=True, eq=False)
class Lights(TensorBatch):
    """The light on B views.

    Attributes
    ----------
    surroundings : (B, levels, 3, rows, 2 rows) tensor
        Radiance, level by level smoothed more, in the convention of `environment_map.directions`.
    alphas : (levels,) tensor
        Roughness for which each level is smoothed; the last one serves the diffuse light.
    turn : (B, 3, 3) tensor
        Rotation from the camera frame to that of the surroundings.
    lamp : (B, K) int64 tensor
        The stored direction from which each lamp shines.
    power : (B, K, 3) tensor
        Irradiance, over pi, of a surface that faces the lamp at the middle of the body; 0 for none.
    distance : (B, K) tensor
        Of the lamp from the middle; infinite for distant ones.
    radius : (B, K) tensor
        Half the angle under which the lamp is seen, radians.
    harmonics : (B, 9, 3) tensor
        Coefficients of the log shading, orthonormal spherical harmonics.
    given : (B,) tensor
        1 where `harmonics` is the only light, else 0.
    bounce : (B,) tensor
        Factor of the bounce.
    """

    surroundings: torch.Tensor
    alphas: torch.Tensor
    turn: torch.Tensor
    lamp: torch.Tensor
    power: torch.Tensor
    distance: torch.Tensor
    radius: torch.Tensor
    harmonics: torch.Tensor
    given: torch.Tensor
    bounce: torch.Tensor

    def chosen(self, which: torch.Tensor) -> Self:
        """Return some of the lights; all have the same `alphas`.

        Parameters
        ----------
        which : (b,) int64 tensor

        Returns
        -------
        Lights
        """
        names = [one.name for one in fields(self) if one.name != "alphas"]
        return replace(self, **{name: getattr(self, name)[which] for name in names})


@dataclass(frozen=True, eq=False)
class LitViews:
    """What the camera would see.

    Attributes
    ----------
    diffuse, specular, shading : (B, P, 3) tensor
        Linear light; `shading` is that of a white surface.
    coefficients : (B, 9, 3) tensor
        The degree-2 harmonics nearest to the log of the shading without shadows, over the
        hemisphere of normals toward the viewer.
    """

    diffuse: torch.Tensor
    specular: torch.Tensor
    shading: torch.Tensor
    coefficients: torch.Tensor


def light_views(views: ViewBatch, material: Material, lights: Lights) -> LitViews:
    """Light views.

    Parameters
    ----------
    views : ViewBatch
    material : Material
    lights : Lights
        All on one device.

    Returns
    -------
    LitViews
    """
    around = _irradiances(views, lights)
    weight = torch.cat([around, views.solid[..., None]], dim=-1)
    gathered = views.reached.to(around.dtype) @ (weight / 255)
    shading, facing = gathered[..., :3], gathered[..., 3:]
    open_share = (facing / _open_sum(views.normal)).clamp(0, 1)
    gloss = _mirrored(views, material, lights, open_share)
    for k in range(lights.lamp.shape[1]):
        which = (lights.power[:, k].amax(-1) > 0).nonzero()[:, 0]
        if len(which):
            direct, shine = _lamp(
                views.chosen(which), material.chosen(which), lights.chosen(which), k
            )
            shading = shading.index_add(0, which, direct)
            gloss = gloss.index_add(0, which, shine)
    mean = views.mean(shading * material.albedo)
    shading = shading + lights.bounce[:, None, None] * (1 - open_share) * mean
    shading, gloss = _as_given(views, lights, shading, gloss)
    diffuse = material.albedo * shading
    which = (material.clear > 0).nonzero()[:, 0]
    if len(which):
        through = _seen_through(views.chosen(which), material.chosen(which), lights.chosen(which))
        diffuse = diffuse.index_copy(0, which, through)
    kept = 1 - reflected_share(material.front, _cosine(views), material.alpha.unsqueeze(-1))
    diffuse = diffuse * kept
    return LitViews(diffuse, gloss, shading, light_coefficients(views, lights))


def _as_given(
    views: ViewBatch, lights: Lights, shading: torch.Tensor, gloss: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """The shading of the harmonics, and no gloss, where they are the only light."""
    which = (lights.given > 0).nonzero()[:, 0]
    if len(which):
        exponent = basis_of(views.normal[which]) @ lights.harmonics[which]
        shading = shading.index_copy(0, which, torch.exp(exponent.clamp(-8, 8)))
        gloss = gloss * (1 - lights.given[:, None, None])
    return shading.clamp(min=_DARKEST), gloss


def _irradiances(views: ViewBatch, lights: Lights) -> torch.Tensor:
    """Irradiance over pi (B, DIRECTIONS, 3) of each stored direction: surroundings, wide lamps."""
    last = torch.full_like(lights.given, len(lights.alphas) - 1)[:, None]
    around = _looked_up(lights, views.directions, last) * (_SOLID_ANGLE / math.pi)
    around = around * views.solid[..., None]
    for k in range(lights.lamp.shape[1]):
        wide = (_is_wide(lights, k) & (lights.power[:, k].amax(-1) > 0)).nonzero()[:, 0]
        if len(wide):
            near = _nearness(views.directions[wide], lights.chosen(wide), k)
            around = around.index_add(0, wide, near[..., None] * lights.power[wide, None, k])
    return around


def _open_sum(normal: torch.Tensor) -> torch.Tensor:
    """Sum (..., 1) of the cosines to all stored directions, if none is hidden.

    The directions are spread evenly over the cap z > `LOWEST`; the part of the sphere below it that
    a normal sees is left out of the integral, which is pi for normals that see none of it.
    """
    lost = _LOST * (1 - normal[..., 2:]).clamp(min=0) ** 2
    return math.pi * (1 - lost) / _SOLID_ANGLE


def _is_wide(lights: Lights, k: int) -> torch.Tensor:
    """Whether (B,) the diffuse light of the k-th lamps comes from several stored directions."""
    return (lights.radius[:, k] > _POINT) & torch.isinf(lights.distance[:, k])


def _nearness(directions: torch.Tensor, lights: Lights, k: int) -> torch.Tensor:
    """Share (B, DIRECTIONS) of the k-th lamps' light that comes from each stored direction."""
    centre = directions.gather(1, lights.lamp[:, k, None, None].expand(-1, 1, 3))
    off = 1 - (directions * centre).sum(-1)
    near = torch.exp(-2 * off / lights.radius[:, k, None] ** 2)
    return near / near.sum(1, keepdim=True)


def _looked_up(lights: Lights, directions: torch.Tensor, level: torch.Tensor) -> torch.Tensor:
    """Radiance (B, M, 3) of the surroundings in directions (B, M, 3), smoothed to levels (B, M)."""
    maps = lights.surroundings.transpose(1, 2)
    levels, rows, columns = maps.shape[2:]
    maps = torch.cat([maps[..., -1:], maps, maps[..., :1]], dim=-1)
    x, y, z = (directions @ lights.turn.mT).unbind(-1)
    row = torch.acos(y.clamp(-1, 1)) * (2 / math.pi) - 1
    column = torch.remainder(torch.atan2(x, -z) * (rows / math.pi), columns)
    depth = (level.expand_as(row) + 0.5) * (2 / levels) - 1
    place = torch.stack([(column + 1) * (2 / (columns + 2)) - 1, row, depth], dim=-1)
    return functional.grid_sample(
        maps, place[:, :, None, None], padding_mode="border", align_corners=False
    )[..., 0, 0].mT


def _level_of(alpha: torch.Tensor, alphas: torch.Tensor) -> torch.Tensor:
    """Level, between two in general, that is smoothed for a roughness."""
    known, wanted = torch.log(alphas), torch.log(alpha)
    above = torch.bucketize(wanted, known).clamp(1, len(known) - 1)
    low, high = known[above - 1], known[above]
    return above - 1 + ((wanted - low) / (high - low)).clamp(0, 1)


def _mirrored(
    views: ViewBatch, material: Material, lights: Lights, open_share: torch.Tensor
) -> torch.Tensor:
    """Gloss (B, P, 3) of the surroundings: of the surface and of its coat."""
    cosine = _cosine(views)
    mirror = 2 * cosine * views.normal - views.toward
    # mirrored, a facet's turn sideways counts less the more the surface is inclined
    level = _level_of(material.alpha * torch.sqrt(cosine[..., 0]), lights.alphas[:-1])
    # S. Lagarde, C. de Rousiers 2014: a sharp mirror sees less of what hides half the hemisphere
    power = torch.exp2(-16 * material.alpha.unsqueeze(-1) - 1)
    free = ((cosine + open_share) ** power - 1 + open_share).clamp(0, 1)
    share = reflected_share(material.front, cosine, material.alpha.unsqueeze(-1))
    gloss = share * _looked_up(lights, mirror, level) * free
    which = (material.coat > 0).nonzero()[:, 0]
    if len(which):
        sharp = _looked_up(lights.chosen(which), mirror[which], torch.zeros_like(cosine[:1, :, 0]))
        coat = _fresnel(material.coat[which, None, None], cosine[which])
        gloss = gloss.index_add(0, which, coat * sharp * open_share[which])
    return gloss


def _lamp(
    views: ViewBatch, material: Material, lights: Lights, k: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Shading and gloss (B, P, 3) of the k-th lamps; wide ones shade with the surroundings."""
    picked = lights.lamp[:, k, None, None]
    centre = views.directions.gather(1, picked.expand(-1, 1, 3))
    reach = centre - views.position / lights.distance[:, k, None, None]
    square_length = reach.square().sum(-1, keepdim=True).clamp(min=0.01)
    toward = reach * torch.rsqrt(square_length)
    steep = (views.normal * toward).sum(-1, keepdim=True)
    reached = views.reached.gather(2, picked.expand(-1, views.reached.shape[1], 1)) > 0
    power = lights.power[:, k, None] * ((steep > 0) & reached) / square_length
    level, cosine = steep.clamp(min=0), _cosine(views)
    half = toward + views.toward
    half = half * torch.rsqrt(half.square().sum(-1, keepdim=True).clamp(min=1e-9))
    aside = (toward * views.toward).sum(-1, keepdim=True) - level * cosine
    rough = _oren_nayar(material.sigma[:, None, None], aside, torch.maximum(level, cosine))
    leaning = (views.normal * half).sum(-1, keepdim=True).clamp(0, 1) ** 2
    incidence = (views.toward * half).sum(-1, keepdim=True)
    spread = torch.tan(lights.radius[:, k, None, None]) ** 2 / (4 * incidence.clamp(min=0.1))
    lobes = [(material.alpha.unsqueeze(-1), material.front)]
    if bool((material.coat > 0).any()):
        lobes.append((torch.full_like(cosine, _COAT), material.coat[:, None, None]))
    gloss = torch.zeros_like(power)
    for alpha, front in lobes:
        square = alpha**2
        hidden = _masking(cosine, square) * _masking(level.clamp(min=_STEEPEST), square)
        shape = _facing_disc(square, leaning, spread)
        gloss = gloss + _fresnel(front, incidence) * (shape * hidden / (4 * cosine))
    alone = (~_is_wide(lights, k)).to(power.dtype)[:, None, None]
    return alone * power * (level * rough), power * gloss


def _cosine(views: ViewBatch) -> torch.Tensor:
    return (views.normal * views.toward).sum(-1, keepdim=True).clamp(min=_STEEPEST)


def _fresnel(front: torch.Tensor, cosine: torch.Tensor) -> torch.Tensor:
    """Schlick's reflectance; 0 where there is no gloss."""
    return (front + (1 - front) * (1 - cosine.clamp(0, 1)) ** 5) * (front > 0)


def _masking(cosine: torch.Tensor, square: torch.Tensor) -> torch.Tensor:
    return 2 * cosine / (cosine + torch.sqrt(square + (1 - square) * cosine**2))


def _facing_disc(square: torch.Tensor, leaning: torch.Tensor, spread: torch.Tensor) -> torch.Tensor:
    """pi times the density of GGX facets, averaged over a disc of slopes.

    `square` is the squared roughness, `leaning` the squared cosine of the half vector, `spread` the
    disc's squared radius. The integral of square / (pi (square + t^2)^2) is closed; its two forms
    avoid differences of nearly equal numbers in and around the disc.
    """
    slope = 1 / leaning.clamp(min=1e-4) - 1
    width = square + slope
    root = torch.sqrt((width + spread) ** 2 - 4 * slope * spread)
    apart = width - spread
    outside = 2 * square / (root * (root + apart.clamp(min=0)))
    inside = (root - apart) / (2 * root * spread)
    return torch.where(apart > 0, outside, inside) / leaning.clamp(min=1e-4) ** 2


def _oren_nayar(sigma: torch.Tensor, aside: torch.Tensor, steep: torch.Tensor) -> torch.Tensor:
    square = sigma**2
    first, second = 1 - 0.5 * square / (square + 0.33), 0.45 * square / (square + 0.09)
    return first + second * aside.clamp(min=0) / steep.clamp(min=_STEEPEST)


def _seen_through(views: ViewBatch, material: Material, lights: Lights) -> torch.Tensor:
    """Surroundings (B, P, 3) behind a body of glass, bent by its front and tinted by its depth."""
    bent = -views.toward - 0.4 * views.normal
    bent = bent / bent.norm(dim=-1, keepdim=True)
    behind = _looked_up(lights, bent, torch.zeros_like(bent[..., 0]))
    return behind * torch.exp(-2 * views.thickness.unsqueeze(-1) * (1 - material.albedo))


def basis_of(normal: torch.Tensor) -> torch.Tensor:
    """Return the nine real spherical harmonics of degree up to 2.

    Parameters
    ----------
    normal : (..., 3) tensor
        Unit vectors.

    Returns
    -------
    (..., 9) tensor
        Orthonormal, in the order of `isc_core.shading.spherical_harmonics`.
    """
    x, y, z = normal.unbind(-1)
    first, second = math.sqrt(3 / (4 * math.pi)), math.sqrt(15 / (4 * math.pi))
    return torch.stack(
        [
            torch.full_like(x, math.sqrt(1 / (4 * math.pi))),
            first * y,
            first * z,
            first * x,
            second * x * y,
            second * y * z,
            math.sqrt(5 / (16 * math.pi)) * (3 * z**2 - 1),
            second * x * z,
            second / 2 * (x**2 - y**2),
        ],
        dim=-1,
    )


def light_coefficients(views: ViewBatch, lights: Lights) -> torch.Tensor:
    """Fit harmonics to the log shading without shadows.

    Parameters
    ----------
    views : ViewBatch
    lights : Lights

    Returns
    -------
    (B, 9, 3) tensor
        Of degree 2, over the hemisphere of normals toward the viewer; those given as they are.
    """
    around = _irradiances(views, lights)
    normals = _hemisphere().to(around)
    light = (normals @ views.directions.mT).clamp(min=0) @ around
    for k in range(lights.lamp.shape[1]):
        toward = views.directions.gather(1, lights.lamp[:, k, None, None].expand(-1, 1, 3))
        alone = (~_is_wide(lights, k)).to(light.dtype)[:, None, None]
        light = light + alone * (normals @ toward.mT).clamp(min=0) * lights.power[:, k, None]
    floor = _FLOOR * light.mean((1, 2), keepdim=True)
    found = torch.linalg.pinv(basis_of(normals)) @ torch.log(light + floor + _DARKEST)
    given = lights.given[:, None, None]
    return given * lights.harmonics + (1 - given) * found


def _hemisphere() -> torch.Tensor:
    """Unit normals (N, 3) toward the viewer, evenly spread over the disc that they project to."""
    k = torch.arange(_NORMALS) + 0.5
    across, turn = torch.sqrt(k / _NORMALS), math.pi * (1 + math.sqrt(5)) * k
    return torch.stack(
        [across * torch.cos(turn), across * torch.sin(turn), torch.sqrt(1 - across**2)], dim=-1
    )
