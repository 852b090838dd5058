"""Lit views as pictures, from which photos are taken."""

from dataclasses import dataclass, replace

import torch

from .lighting import LitViews
from .pictures import Bank, lit_pictures
from .tensor_batch import TensorBatch
from .view_batches import ViewBatch, stretched
from .views import SIDE

_LEAST_LAMP = 0.12  # of all lamps' light in the picture: below, a lamp does not count
_BRIGHTEST = 6e4
_LEAST_LIT = 0.02  # of the surroundings' light: below, a lamp does not count


@dataclass(frozen=True, eq=False)
class LitPictures(TensorBatch):
    """Pictures of B lit views, before any camera.

    Attributes
    ----------
    layers : (B, 13, SIDE, SIDE) float16 tensor
        Diffuse and specular light, shading, normal, depth; 0 off the body.
    cover : (B, 1, SIDE, SIDE) float16 tensor
        1 on the body.
    coefficients : (B, 9, 3) tensor
        Of the log shading.
    ground : (B, 3) tensor
        Light of the background.
    lamps : (B,) int64 tensor
        How many count: 0, 1, or 2 for several.
    strongest : (B, 3) tensor
        Unit vector to the lamp that gives most light.
    kind : (B,) int64 tensor
    aspect : (B, 2) tensor
        Factors of the picture's width and height: bodies are stretched, pictures are not yet.
    """

    layers: torch.Tensor
    cover: torch.Tensor
    coefficients: torch.Tensor
    ground: torch.Tensor
    lamps: torch.Tensor
    strongest: torch.Tensor
    kind: torch.Tensor
    aspect: torch.Tensor

    def with_light(self, diffuse: torch.Tensor, specular: torch.Tensor) -> "LitPictures":
        """Return pictures with other light.

        Parameters
        ----------
        diffuse, specular : (B, 3, SIDE, SIDE) tensor
            Not negative. Specular light is limited to what half floats hold.

        Returns
        -------
        LitPictures
        """
        rest = self.layers[:, 6:].float()
        layers = torch.cat([diffuse, specular.clamp(max=_BRIGHTEST), rest], 1)
        return replace(self, layers=layers)


def make_pictures(views: ViewBatch, recipes: dict[str, torch.Tensor], bank: Bank) -> LitPictures:
    """Paint and light views.

    Parameters
    ----------
    views : ViewBatch
    recipes : dict of str to tensor
        See `pictures.stacked`.
    bank : Bank
        All on one device.

    Returns
    -------
    LitPictures
    """
    if bool((recipes["stretch"] != 1).any()):
        views = stretched(views, recipes["stretch"])
    lit = lit_pictures(views, recipes, bank)
    rows = [lit.diffuse, lit.specular, lit.shading, views.normal, views.position[..., 2:]]
    values = torch.cat([*rows, torch.ones_like(views.thickness)[..., None]], dim=-1)
    batch, _, channels = values.shape
    canvas = torch.zeros(batch, SIDE * SIDE + 1, channels, device=values.device)
    canvas.scatter_(1, views.index[..., None].expand(-1, -1, channels), values)
    picture = canvas[:, :-1].mT.reshape(batch, channels, SIDE, SIDE)
    # half floats end at 65504; a lamp mirrored in metal may be brighter
    picture = picture.clamp(max=_BRIGHTEST).half()
    lamps, strongest = _lamps(views, recipes)
    return LitPictures(
        picture[:, :-1],
        picture[:, -1:],
        lit.coefficients,
        _background(views, lit, recipes),
        lamps,
        strongest,
        recipes["kind"],
        recipes["stretch"][:, :2],
    )


def _background(views: ViewBatch, lit: LitViews, recipes: dict[str, torch.Tensor]) -> torch.Tensor:
    """A colour (B, 3) behind the object, from black to as bright as its brightest parts."""
    level = (recipes["shifts"][:, 0, :1] * 2).clamp(0, 2)
    return level * views.mean(lit.diffuse)[:, 0]


def _lamps(views: ViewBatch, recipes: dict[str, torch.Tensor]) -> tuple[torch.Tensor, torch.Tensor]:
    """How many lamps count (B,), and the direction (B, 3) of the strongest."""
    power = recipes["power"].mean(-1)
    toward = views.directions.gather(1, recipes["lamp"][..., None].expand(-1, -1, 3))
    lamps = recipes["lamp"][:, None].expand(-1, views.normal.shape[1], -1)
    light = power * views.mean(views.reached.gather(2, lamps).float())[:, 0] / 255
    ambient = recipes["ambient"].mean(-1)
    counts = light > _LEAST_LAMP * light.sum(1, keepdim=True).clamp(min=1e-6)
    counts &= light > _LEAST_LIT * ambient[:, None]
    number = counts.sum(1).clamp(max=2) * (recipes["given"] == 0)
    best = light.argmax(1)
    return number, toward[torch.arange(len(best), device=best.device), best]
