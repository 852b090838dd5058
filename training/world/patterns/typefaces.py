"""The fonts of the machine, by the scripts that they can write.

Searched are the package data of matplotlib, what its font manager finds on the system, and the
fonts that other installed packages bring (Blender's module has most of the world's scripts). A
font can write a script if samples of its letters differ from the sign for a missing letter.

Limits: symbol fonts in special encodings are left out by name.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from functools import cache, lru_cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from PIL import ImageFont

from isc_core.errors import InputError
from isc_core.extras import install_command

_SUFFIXES = (".ttf", ".otf", ".woff2")
_PACKAGES = ("bpy", "mkdocs")  # installed packages that bring fonts
_NOT_FOR_TEXT = re.compile(r"LastResort|cmex|cmsy|STIXSiz|STIXNonUni|glyphicons|awesome|fa-", re.I)
_MISSING = "\U0010fffe"
_TRIAL = 24  # pixels of an em, to try letters


class Script(Enum):
    """Letters that words are made of; the first few are what a font is tried with."""

    LATIN = "etaoinshrdlucmfwypvbgkqjxzETAOINSHRDLUCMFWYPVBGKQJXZ"
    GREEK = "αβγδεζηθικλμνξοπρστυφχψωΑΒΓΔΕΖΗΘΛΞΠΣΦΨΩ"
    CYRILLIC = "абвгдежзиклмнопрстуфхцчшщыэюяБГДЖИЛПФЦЧШЯ"
    HEBREW = "אבגדהוזחטיכלמנסעפצקרשת"
    ARABIC = "ابتثجحخدذرزسشصضطظعغفقكلمنهوي"
    DEVANAGARI = "कखगघचछजझटठडढणतथदधनपफबभमयरलवशषसह"
    BENGALI = "কখগঘচছজঝটঠডঢণতথদধনপফবভমযরলশষসহ"
    TAMIL = "கஙசஞடணதநபமயரலவழளறன"
    THAI = "กขคฆงจฉชซฌญฎฏฐฑฒณดตถทธนบปผพภมยรลวศษสหอฮ"
    ARMENIAN = "աբգդեզէըթժիլխծկհձղճմյնշոչպջռսվտրցւփքօֆ"
    GEORGIAN = "აბგდევზთიკლმნოპჟრსტუფქღყშჩცძწჭხჯჰ"
    ETHIOPIC = "ሀለሐመሠረሰሸቀበተቸኀነኘአከኸወዐዘዠየደጀገጠጨጰጸፀፈፐ"
    HAN = "人大中国食品水茶山川日本東京花米油海風月金木火土新安全保存方法製造会社用品質味"
    KANA = "あいうえおかきくけこさしすせそたちつてとアイウエオカキクケコサシスセソタチツテト"
    HANGUL = "가나다라마바사아자차카타파하한국물차밥김치고기우유사랑"
    SYMBOLS = "★☀☂☎♞♥♣✈✂☯☘⚓⚙⚡♫❄☕✿❖➤✪☺♻⚽"


@dataclass(frozen=True)
class Typeface:
    """A font file.

    Attributes
    ----------
    path : str
    family : str
        The first words of its name: fonts of one family look alike.
    scripts : frozenset of Script
        What it can write.
    variable : bool
        It has a range of weights.
    """

    path: str
    family: str
    scripts: frozenset[Script]
    variable: bool


@cache
def typefaces() -> tuple[Typeface, ...]:
    """Return the fonts of the machine.

    Returns
    -------
    tuple of Typeface
        In the order of family and style, each of them once.

    Raises
    ------
    InputError
        If matplotlib, whose fonts are the least, is not installed.
    """
    found: dict[tuple[str, str], Typeface] = {}
    for path in sorted(_font_files(), key=lambda one: (one.name, str(one))):
        if _NOT_FOR_TEXT.search(path.name):
            continue
        try:
            font = sized_font(str(path), _TRIAL)
        except OSError:  # a format that this build of FreeType does not know
            continue
        scripts = frozenset(
            script
            for script in Script
            if all(has_sign(str(path), letter) for letter in script.value[:6])
        )
        family, style = (part or "" for part in font.getname())
        if scripts:
            variable = bool(_axes(font))
            look = " ".join(family.split()[:2])
            found.setdefault((family, style), Typeface(str(path), look, scripts, variable))
    return tuple(found[name] for name in sorted(found))


def draw_typeface(rng: np.random.Generator, script: Script) -> Typeface:
    """Draw a font for a script: first its family, then one of it.

    Parameters
    ----------
    rng : numpy.random.Generator
    script : Script
        One that some font can write.

    Returns
    -------
    Typeface
    """
    able = [face for face in typefaces() if script in face.scripts]
    families = sorted({face.family for face in able})
    family = families[int(rng.integers(len(families)))]
    members = [face for face in able if face.family == family]
    return members[int(rng.integers(len(members)))]


def draw_script(rng: np.random.Generator) -> Script:
    """Draw a script: Latin in two of three cases, else any other that can be written.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    Script
    """
    able = frozenset().union(*(face.scripts for face in typefaces()))
    others = [one for one in Script if one in able - {Script.LATIN, Script.SYMBOLS}]
    if rng.random() < 2 / 3 or not others:
        return Script.LATIN
    return others[int(rng.integers(len(others)))]


@lru_cache(maxsize=256)
def sized_font(path: str, size: int, weight: int = 0) -> ImageFont.FreeTypeFont:
    """Open a font.

    Parameters
    ----------
    path : str
    size : int
        Pixels of an em.
    weight : int
        0 to 4, thin to heavy, where the font is variable.

    Returns
    -------
    ImageFont.FreeTypeFont
    """
    font = ImageFont.truetype(path, size)
    axes = _axes(font)
    if axes:
        font.set_variation_by_axes([low + (high - low) * weight / 4 for low, high in axes])
    return font


@lru_cache(maxsize=1 << 14)
def has_sign(path: str, letter: str) -> bool:
    """Tell whether a font has a letter.

    Parameters
    ----------
    path : str
    letter : str

    Returns
    -------
    bool
        Also for a blank.
    """
    font = sized_font(path, _TRIAL)
    return letter == " " or bytes(font.getmask(letter)) not in (_missing(path), b"")


def _axes(font: ImageFont.FreeTypeFont) -> list[tuple[int, int]]:
    """The ranges of weight, width and the like of a variable font."""
    try:
        return [(axis["minimum"] or 0, axis["maximum"] or 0) for axis in font.get_variation_axes()]
    except OSError:  # not variable
        return []


def _font_files() -> Iterator[Path]:
    try:
        from matplotlib import font_manager, get_data_path
    except ImportError as error:
        raise InputError(
            f"printed patterns need the fonts of matplotlib: {install_command('thesis')}"
        ) from error
    yield from Path(get_data_path(), "fonts", "ttf").glob("*.ttf")
    yield from (Path(name) for name in font_manager.findSystemFonts())
    for package in _PACKAGES:
        spec = find_spec(package)
        for folder in (spec.submodule_search_locations or ()) if spec else ():
            yield from (path for path in Path(folder).rglob("*") if path.suffix in _SUFFIXES)


@lru_cache(maxsize=256)
def _missing(path: str) -> bytes:
    """How a font shows a letter that it does not have."""
    return bytes(sized_font(path, _TRIAL).getmask(_MISSING))
