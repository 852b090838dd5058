"""All laws."""

from .decomposition_laws import LAWS as DECOMPOSITION
from .law import Law
from .separation_laws import LAWS as SEPARATION
from .tool_laws import LAWS as TOOLS

LAWS: tuple[Law, ...] = (*SEPARATION, *DECOMPOSITION, *TOOLS)
