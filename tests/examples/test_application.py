"""The program of docs/how_to/application.md, as it stands there."""

import asyncio
import re
from pathlib import Path
from typing import Any

from chefbotd.clock import run_virtual
from chefbotd.testing.daemon import running_daemon
from chefbotd.testing.transport import FakeSerialDevice

PAGE = Path(__file__).parents[2] / "docs" / "how_to" / "application.md"


def test_the_documented_application_comes_when_its_button_is_pressed() -> None:
    """It registers, offers its button, and ends once it has answered the press."""
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)

    async def scenario() -> None:
        async with running_daemon(FakeSerialDevice()) as client:
            here = code.replace("Client.connect(", f"Client.connect(*{client.address}, ")
            made: dict[str, Any] = {}
            exec(compile(here.replace("asyncio.run(main())", ""), str(PAGE), "exec"), made)
            application = asyncio.create_task(made["main"]())
            await asyncio.sleep(1.0)
            (button,) = (await client.get_state()).agents.buttons
            assert (button.agent, button.label) == ("doorbell", "Come to the door")
            await client.press_button(button.button_id)
            await asyncio.wait_for(application, 5.0)
            lines = (await client.get_state()).topics["log"].data.lines
            assert "I am coming" in [line.text for line in lines]

    run_virtual(scenario())
