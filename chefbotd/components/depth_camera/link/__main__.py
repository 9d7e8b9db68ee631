"""``python -m chefbotd.components.depth_camera.link PARAMETERS``: the process of one depth camera."""

import sys

from chefbotd.components.depth_camera.link.child import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
