"""One entry point for all commands: ``cybership NAME ...`` is ``python -m MODULE ...``."""

if __name__ == "__main__":
    from cosim.interrupts import leave_on_interrupt

    leave_on_interrupt()  # before all other imports, which take a while

import runpy
import sys

from .standard_streams import code_of
from .subcommands import SUBCOMMANDS, all_modules, purpose

USAGE = """usage: cybership COMMAND [...]

{commands}

'cybership COMMAND --help' describes a command; start with 'cybership demo' or 'cybership run ellipse'.
Shipped scenarios may be named without a path.
Exit codes: 0 done, 2 bad input, 3 failed, 130 interrupted."""


def usage() -> str:
    """The text of ``cybership --help``."""
    modules = all_modules()
    wide = max(map(len, modules))
    lines = (f"  {name:{wide}} {purpose(name, module)}" for name, module in modules.items())
    return USAGE.format(commands="\n".join(lines))


def main() -> int:
    """Run the command that is named; the exit code if there is none to run."""
    if sys.argv[1:2] == ["help"] and len(sys.argv) == 3:  # help run
        sys.argv[1:] = [sys.argv[2], "--help"]
    name = sys.argv[1] if len(sys.argv) > 1 else "--help"
    if name in ("-h", "--help", "help"):
        print(usage())
        return 0
    if name == "--version":
        from importlib.metadata import version

        print(f"cybership {version('cybership')}")
        return 0
    own = SUBCOMMANDS.get(name)
    modules = all_modules() if own is None else {name: own.module}
    if name not in modules:
        from cosim.command import complain
        from cosim.errors import nearest

        complain(f"no command '{name}'{nearest(name, modules)}")
        return 2
    from cosim.supervision import end_without_extra

    sys.excepthook = end_without_extra
    sys.argv = [f"cybership {name}", *sys.argv[2:]]
    # As python -m does it: what a command does before its imports happens here, too. But sys.argv[0]
    # stays the name of the command, by which usage lines call it.
    runpy.run_module(modules[name], run_name="__main__")
    return 0


if __name__ == "__main__":
    sys.exit(code_of(main))
