"""`python -m orchestrator` is `auv-fmu`."""

import sys

from orchestrator.commands.main import main

sys.exit(main())
