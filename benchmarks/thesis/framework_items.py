"""Items of the thesis that are not here yet."""

from .item import Item

ITEMS: tuple[Item, ...] = ()
