"""Start the command: ``python -m fmus.check``."""

if __name__ == "__main__":
    from fmus.interruption import leave_on_interrupt

    leave_on_interrupt()  # before all other imports, which take a while

from ..interruption import run_interruptible
from .checking import main

if __name__ == "__main__":
    run_interruptible(main)
