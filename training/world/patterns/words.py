"""Words for printed surfaces: product words, made-up words, numbers, dates and prices."""

import numpy as np

from .typefaces import Script

_LINES = (
    "fresh pure organic coffee milk sugar classic original new extra natural quality premium",
    "family large warning danger fragile keep open here best before contents made with water",
    "salt oil vinegar tomato apple orange lemon cherry chocolate vanilla cream soap shampoo",
    "baking powder rice beans corn soup sauce strong gentle super power light sport music radio",
    "hotel museum library park station market garden summer winter city world team club number",
    "Frühstück Käse Brot Milch Straße schön Qualität Zutaten süß kühl lagern und mit der die das",
    "café crème pâte fraîche eau douce déjà forêt sucre beurre naturel goût",
    "año mañana niño leche azúcar español señor corazón agua",
    "acqua latte caffè olio pomodoro perché dolce pane",
    "öl smör mjölk blåbär rødgrød æble kød pão açúcar não żółty łąka źródło čaj škoda řeka ďábel",
)
_WORDS = tuple(word for line in _LINES for word in line.split())
_UNITS = ("g", "kg", "ml", "l", "%", "cm", "oz", "W", "V", "kcal", "mm", "°C", "€", "$")


def phrase(rng: np.random.Generator, script: Script, count: int) -> str:
    """Draw words.

    Parameters
    ----------
    rng : numpy.random.Generator
    script : Script
    count : int
        Of words.

    Returns
    -------
    str
        In any case where the script has one.
    """
    words = [word(rng, script) for _ in range(count)]
    joined = " ".join(words)
    case = int(rng.integers(3))
    return joined.upper() if case == 0 else joined.title() if case == 1 else joined


def word(rng: np.random.Generator, script: Script) -> str:
    """Draw a word.

    Parameters
    ----------
    rng : numpy.random.Generator
    script : Script

    Returns
    -------
    str
        A real or a made-up one, or a number.
    """
    kind = rng.random()
    if kind < 0.12:
        return number(rng)
    if script is Script.LATIN and kind < 0.8:
        return _WORDS[int(rng.integers(len(_WORDS)))]
    if script is Script.LATIN:
        return "".join(
            str(rng.choice(list("bcdfghjklmnprstvwxz"))) + str(rng.choice(list("aeiouy")))
            for _ in range(int(rng.integers(1, 5)))
        )
    letters = list(script.value)
    return "".join(letters[k] for k in rng.integers(0, len(letters), int(rng.integers(2, 8))))


def number(rng: np.random.Generator) -> str:
    """Draw a number: a quantity, price, date, serial number or percentage.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    str
    """
    kind = int(rng.integers(5))
    if kind == 0:
        return f"{rng.integers(1, 1000)} {_UNITS[int(rng.integers(len(_UNITS)))]}"
    if kind == 1:
        return f"{rng.integers(1, 100)}.{rng.integers(0, 100):02d}"
    if kind == 2:
        return f"{rng.integers(1, 29):02d}.{rng.integers(1, 13):02d}.{rng.integers(1950, 2060)}"
    if kind == 3:
        return f"No {rng.integers(1, 100000)}-{chr(65 + int(rng.integers(26)))}"
    return str(rng.integers(0, 10 ** int(rng.integers(1, 8))))
