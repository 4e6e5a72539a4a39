"""`python3 -m hero_sim`."""

import signal
import sys

# Loading takes a moment: Ctrl-C in it ends the program like any other, without a stack trace.
signal.signal(signal.SIGINT, signal.SIG_DFL)

try:
    from .main import main
except ModuleNotFoundError as missing:
    sys.exit(
        "hero_sim: %s is missing; install python3-numpy and python3-yaml, and put hero_driver/src and"
        " hero_node/src, which lie beside hero_sim, on PYTHONPATH" % missing.name
    )

sys.exit(main())
