"""The row of chefbotctl's status for the camera."""

from chefbotd.cli.common.state_text import Data, Fact, Style


def camera(data: Data) -> Fact:
    """Whether it sends pictures, and why not."""
    if data["state"] == "failed":
        return Fact("camera", f"no picture: {data['reason']}", Style.NOTICE)
    size = f", {data['width_px']} x {data['height_px']}" if data["width_px"] else ""
    words = {"off": "off, nobody looks", "starting": "starting", "running": f"running{size}"}
    return Fact("camera", words[data["state"]])
