"""Names that moved to the package ``thesis``; the old ones work for one release and say so.

``python -m diagnosis.pca`` and ``import diagnosis.analysis`` run and give ``thesis.pca`` and
``thesis.analysis``, with one line on standard error; so the studies of the thesis.
"""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from types import CodeType, ModuleType

MOVED = {
    "diagnosis": "analysis open_loop pca pls replay sysid watch",
    "studies": "allocation basin_trials chapter5 chapter6 chapter7 error_models estimators improved "
    "lost_thrust monte_carlo observer_gains observers realtime store_weight tracking",
}


class MovedModules:
    """Finds old names in the way of the import system (:pep:`451`): finder and loader in one."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """The specification of a module by its old name; None if it is another one."""
        package, _, inner = name.partition(".")
        if inner.partition(".")[0] not in MOVED.get(package, "").split():
            return None
        return ModuleSpec(name, self)  # pyright: ignore[reportArgumentType] - has what is called

    def get_code(self, name: str) -> CodeType:
        """What ``python -m`` of the old name runs."""
        run = f"import runpy; runpy.run_module({_new(name)!r}, run_name='__main__', alter_sys=True)"
        return compile(run, name, "exec")

    def create_module(self, spec: ModuleSpec) -> None:
        """None: a module of the usual kind, which :meth:`exec_module` replaces."""

    def exec_module(self, module: ModuleType) -> None:
        """Import the module by its new name, which an import of the old one gives."""
        sys.modules[module.__name__] = import_module(_new(module.__name__))


def _new(name: str) -> str:
    new = f"thesis.{name.partition('.')[2]}"
    if name.count(".") == 1:  # once for a package
        sys.stderr.write(f"note: {name} has the new name {new}; the next release removes the old name\n")
    return new


def keep_old_names() -> None:
    """Let the import system find modules by their old names."""
    if not any(isinstance(finder, MovedModules) for finder in sys.meta_path):
        sys.meta_path.insert(0, MovedModules())  # before what looks in the folders of thesis
