"""`python3 -m hero_sim`."""

import sys

from .main import main

sys.exit(main())
