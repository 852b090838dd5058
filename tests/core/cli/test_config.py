"""Defaults of options from isc.toml."""

from pathlib import Path

import pytest

from isc_core.cli.commands import build_parser
from isc_core.cli.config import apply_config
from isc_core.cli.main import main
from isc_core.errors import InputError


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def parsed(text: str, *words: str, file: str = "isc.toml") -> dict[str, object]:
    """The options of a command line beside a configuration file."""
    Path(file).parent.mkdir(exist_ok=True)
    Path(file).write_text(text)
    arguments = list(words)
    parser = build_parser(arguments)
    apply_config(parser, arguments)
    return vars(parser.parse_args(arguments))


WORDS = ("decompose", "a.png", "-o", "out")


def test_the_file_sets_defaults_and_the_command_line_wins() -> None:
    text = '[decompose]\nmodel = "sirfs"\nmax-size = 300\nfull-size = true\n[batch]\nworkers = 2\n'
    options = parsed(text, *WORDS)
    assert (options["model"], options["max_size"], options["full_size"]) == ("sirfs", 300, True)
    for words in (("--max-size", "200"), ("--max-size=200",)):
        options = parsed(text, *WORDS, *words)
        assert (options["max_size"], options["full_size"]) == (200, False)
    assert parsed(text, *WORDS, "--no-config")["model"] == "joint"


def test_a_file_elsewhere_is_named_and_its_paths_are_its_own() -> None:
    text = '[decompose]\npriors = "mine.npz"\n'
    options = parsed(text, *WORDS, "--config", "there/my.toml", file="there/my.toml")
    assert options["priors"] == Path("there/mine.npz")


def test_actions_have_tables_inside_their_command() -> None:
    text = '[edit.gloss]\nlook = "metallic"\n[edit.highlight]\ndirection = [0, 0.5, 1]\n'
    assert parsed(text, "edit", "cup", "gloss", "-o", "out")["look"] == "metallic"
    light = parsed(text, "edit", "cup", "highlight", "-o", "out")
    assert light["direction"] == [0, 0.5, 1]


def test_a_byte_order_mark_of_windows_is_no_part_of_the_text() -> None:
    assert parsed('\ufeff[decompose]\nmodel = "sirfs"\n', *WORDS)["model"] == "sirfs"


def test_a_repeated_option_replaces_the_list_of_the_file() -> None:
    text = '[decompose]\npoint = ["1,2", "3,4"]\nnot = ["5,6"]\n'
    options = parsed(text, *WORDS)
    assert (options["points"], options["others"]) == ([(1, 2), (3, 4)], [(5, 6)])
    options = parsed(text, *WORDS, "--point", "7,8", "--point", "9,9")
    assert (options["points"], options["others"]) == ([(7, 8), (9, 9)], [(5, 6)])


def test_the_file_can_set_one_of_options_that_exclude_each_other() -> None:
    words = ("export", "cup", "-o", "out")
    text = '[export]\ntextures = "unity"\n'
    assert parsed(text, *words)["textures"] == "unity"
    assert parsed(text, *words, "--textures", "generic")["textures"] == "generic"
    options = parsed(text, *words, "--format", "obj")
    assert (options["textures"], options["format"]) == (None, "obj")
    with pytest.raises(InputError, match="textures and format of .export. exclude each other"):
        parsed(f'{text}format = "obj"\n', *words)
    with pytest.raises(InputError, match="not allowed with"):
        parsed(text, *words, "--format", "obj", "--textures", "unity")


def test_paths_that_may_be_something_else_are_relative_to_the_file(folder: Path) -> None:
    def value(option: str, text: str, *words: str) -> object:
        given = f'[{words[0]}]\n{option} = "{text}"\n'
        return parsed(given, *words, "--config", "there/my.toml", file="there/my.toml")[option]

    batch, validate = ("batch", "photos", "-o", "out"), ("validate", "scenes", "-o", "out")
    assert value("masks", "masks", *batch) == "there/masks"
    assert value("masks", f"{folder}/masks", *batch) == f"{folder}/masks"
    assert value("masks", "s3://bucket/masks", *batch) == "s3://bucket/masks"
    assert value("bounds", "mine.json", *validate) == "there/mine.json"
    assert value("bounds", "none", *validate) == "none"


def test_lists_of_names_and_repeated_options() -> None:
    options = parsed(
        '[separate]\nset = ["a=1", "b=2"]\nmethod = "shen_2013"\n', "separate", "a.png", "-o", "out"
    )
    assert (options["changes"], options["method"]) == (["a=1", "b=2"], "shen_2013")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[decompose]\nmodell = 'mdr'", "[decompose] has no option 'modell': did you mean model?"),
        ("[decompos]\n", "unknown command 'decompos': did you mean decompose?"),
        ("model = 'sirfs'", "'model' is outside any table"),
        ("[decompose]\nmax-size = -3", "max-size of [decompose]: '-3' is not a whole number"),
        ("[decompose]\nmax-size = [3]", "must be one value, not [3]"),
        ('[decompose]\nfull-size = "yes"', "must be true or false, not 'yes'"),
        ('[decompose]\nillumination = "sun"', "unknown 'sun': choose photo, natural, laboratory"),
        ("[decompose]\noutput = 'x'", "has no option 'output'"),
        ("[edit.relight]\ndirection = [1.0, 0.2]", "must be a list of 3 values, not [1.0, 0.2]"),
        ("[edit.relight]\ndirection = []", "must be a list of 3 values, not []"),
        ("[decompose\n", "is not valid TOML"),
        ("[decompose]\nmodel = 1979-05-27", "must be a text or a number"),
    ],
)
def test_mistakes_name_the_file_and_the_option(text: str, message: str) -> None:
    words = ("edit", "cup", "relight", "-o", "out") if "[edit" in text else WORDS
    with pytest.raises(InputError) as refusal:
        parsed(text, *words)
    assert str(refusal.value).startswith("isc.toml")
    assert message in str(refusal.value)


def test_a_missing_file_is_one_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*WORDS, "--config", "none.toml"]) == 2
    assert capsys.readouterr().err.startswith("isc: error: none.toml: no such file")


@pytest.mark.parametrize("words", [["decompose", "--help"], ["export", "-h"], ["--version"]])
def test_the_help_needs_no_valid_file(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    Path("isc.toml").write_text("[decompose\n")
    assert main(words) == 0
    assert "isc" in capsys.readouterr().out


def test_a_file_that_is_not_text_is_one_error(capsys: pytest.CaptureFixture[str]) -> None:
    Path("isc.toml").write_bytes(b"\xff\xfe[decompose]")
    assert main([*WORDS]) == 2
    assert "is not UTF-8" in capsys.readouterr().err


def test_an_implicit_file_cannot_set_the_scheduler() -> None:
    text = '[batch]\nscheduler = "tcp://192.0.2.1:8786"\n'
    words = ("batch", "photos", "-o", "out")
    with pytest.raises(InputError, match="isc.toml: scheduler of .batch. is accepted only from"):
        parsed(text, *words)
    options = parsed(text, *words, "--config", "isc.toml")
    assert options["scheduler"] == "tcp://192.0.2.1:8786"
    assert parsed(text, *words, "--no-config")["scheduler"] == ""
