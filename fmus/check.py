"""Start the command: ``python -m fmus.check``; the checks themselves are the package ``fmucheck``."""

if __name__ == "__main__":
    from fmus.interruption import leave_on_interrupt

    leave_on_interrupt()  # before all other imports, which take a while

from fmucheck.checking import main

from .interruption import run_interruptible

if __name__ == "__main__":
    run_interruptible(main)
