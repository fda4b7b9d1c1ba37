"""``python -m translucent`` is the command line."""

import sys

from translucent.cli import main

sys.exit(main())
