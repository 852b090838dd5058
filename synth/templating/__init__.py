"""Text files from Jinja2 templates, which are in a folder `templates` next to their code."""

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from isc_core.errors import InputError
from isc_core.extras import install_command

if TYPE_CHECKING:
    from jinja2 import Environment


def render(module: str, template: str, **values: object) -> str:
    """Fill a template.

    Parameters
    ----------
    module : str
        `__file__` of the caller; the template is in the folder `templates` next to it.
    template : str
        File name. Values are escaped in templates that end in `.html.j2`.
    **values : object
        The template's variables. All variables must be defined.

    Returns
    -------
    str
        The text.

    Raises
    ------
    InputError
        If Jinja2 is not installed.
    """
    folder = Path(module).with_name("templates")
    return _environment(folder).get_template(template).render(**values)


@cache
def _environment(folder: Path) -> "Environment":
    try:
        from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape
    except ImportError as error:
        raise InputError(
            f"writing reports needs Jinja2: install it with `{install_command('synth')}`"
        ) from error
    return Environment(
        loader=FileSystemLoader(folder),
        autoescape=select_autoescape(enabled_extensions=("html.j2",)),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
