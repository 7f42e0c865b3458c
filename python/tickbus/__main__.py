"""``python -m tickbus`` is the ``tickbus`` command."""

import sys

from ._command import main

sys.exit(main())
