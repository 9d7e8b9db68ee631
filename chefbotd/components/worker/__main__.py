"""The program that the daemon starts as its worker."""

import sys

from chefbotd.components.worker.main import main

sys.exit(main(sys.argv[1:]))
