"""`python -m hdtrapeze` is the command `hdtrapeze`."""

import sys

from .cli import main

sys.exit(main())
