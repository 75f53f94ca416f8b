"""`python -m lerobot_bimanual.cli`: the command line where its program is not on the path."""

import sys

from lerobot_bimanual.cli.command_line import main

sys.exit(main())
