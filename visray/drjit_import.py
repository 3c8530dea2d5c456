"""What happens when Dr.Jit is imported: visray chooses a libLLVM first, because the import loads LLVM."""

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import module_from_spec
from types import ModuleType
from typing import Any

# Name of the module whose import loads LLVM.
EXTENSION = "drjit._drjit_ext"


class _Watch:
    """Finder of modules that finds none. It chooses a libLLVM in the moment before Dr.Jit is imported."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> None:
        """Chooses a libLLVM if `name` is Dr.Jit or a module in it."""
        if name.partition(".")[0] == "drjit":
            import_module("visray.llvm").prepare()
            sys.meta_path.remove(self)


def watch() -> None:
    """From now on, a libLLVM is chosen before Dr.Jit is imported, by whatever module."""
    sys.meta_path.insert(0, _Watch())


def put_off() -> None:
    """From now on, `import drjit` gives a module that is loaded when it is first used. The command line needs this to
    refuse a wrong scene at once.

    Domain: a single thread, until Dr.Jit is loaded.
    """
    spec = None if "drjit" in sys.modules else PathFinder.find_spec("drjit")
    if spec is not None:
        sys.modules["drjit"] = later = _Later("drjit")
        vars(later).update(vars(module_from_spec(spec)))
        # The import of a submodule, such as drjit.llvm, asks for this attribute first, and so it loads Dr.Jit.
        del later.__path__


class _Later(ModuleType):
    """A module that is loaded when it is first asked for an attribute. importlib.util.LazyLoader is no help, because
    there the second `import` of the module loads it."""

    def __getattr__(self, name: str) -> Any:
        self.__class__ = ModuleType
        self.__path__ = self.__spec__.submodule_search_locations
        self.__loader__.exec_module(self)
        if name == "__path__":
            sys.meta_path.insert(0, _Once())
        return getattr(self, name)


class _Once:
    """Finder for the submodule whose import has just loaded Dr.Jit. Dr.Jit imports its submodules itself; this finder
    gives that module, where the import would otherwise run the submodule's file a second time."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """The module as it is if it is loaded, otherwise None. Asked only once."""
        sys.meta_path.remove(self)
        return ModuleSpec(name, self) if name in sys.modules else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """The module that is loaded."""
        return sys.modules[spec.name]

    def exec_module(self, module: ModuleType) -> None:
        """Nothing is left to do."""
