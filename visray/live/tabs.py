"""The tabs beside the live picture."""

from typing import Any
from weakref import WeakKeyDictionary

# Names of the tabs, in their order.
NAMES = ("Scene", "Pixel", "Price", "Save")
_MADE: WeakKeyDictionary[Any, dict[str, Any]] = WeakKeyDictionary()


def tab(server: Any, name: str) -> Any:
    """The tab with one of the NAMES: a container for widgets, which all browsers share. All tabs are made when the
    first one is asked for.

    server: the ViserServer.
    """
    if server not in _MADE:
        group = server.gui.add_tab_group()
        _MADE[server] = {each: group.add_tab(each) for each in NAMES}
    return _MADE[server][name]
