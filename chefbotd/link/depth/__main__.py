"""``python -m chefbotd.link.depth PARAMETERS``: the process of one depth camera."""

import sys

from chefbotd.link.depth.child import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
