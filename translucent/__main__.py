"""``python -m translucent`` is the command line, and so is the script ``translucent``."""

import gc
import os
import signal
import sys


def main() -> int:
    """Run the command line and return its exit code; Ctrl-C is one line from the first import on."""
    # A shell that starts the command with & has it ignore Ctrl-C.
    heeds = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if heeds:
        # Nothing has begun. An exception would be lost where Python imports by callbacks.
        signal.signal(signal.SIGINT, _leave)
    # Matrices are small here, or many are multiplied at once: more threads of a BLAS would wait in busy loops.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # Imports and readers of files make many objects that stay: looking for garbage each 700 takes a tenth of a second.
    gc.set_threshold(50_000)
    from translucent.cli import main

    if heeds:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    code = main()
    if heeds:  # Python shows where it was interrupted while it ends
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    return code


def _leave(*_: object) -> None:
    os.write(2, b"error: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    sys.exit(main())
