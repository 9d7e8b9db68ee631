"""Secrets in a configuration: where they are shown, which is nowhere."""

import re
from pathlib import Path

import pytest

from chefbotd.components.doctor.cli.bundle import texts_in
from chefbotd.process.reload import _plain
from chefbotd.settings import Settings, SettingsError, load

SECRET = "open-sesame-0123456789"
PLANTED = f"""
[plugins]
allow = ["house"]
[plugins.settings.house]
url = "https://ann:{SECRET}@example.org/"
auth = ["basic", "{SECRET}"]
mqtt = {{ pw = "{SECRET}", port = 1883 }}
"""


def configured(chefbot: Path, text: str) -> Settings:
    """The robot's configuration with some lines more, in place of a section of that name."""
    section = text.strip().partition("\n")[0]
    kept = re.sub(rf"(?ms)^{re.escape(section)}$.*?(?=^\[|\Z)", "", chefbot.read_text())
    chefbot.write_text(f"{kept}\n{text}\n")
    return load(chefbot)


def test_settings_of_plugins_are_in_no_json(chefbot: Path) -> None:
    """Which recordings and bundles hold; the plug-in itself gets them, and a reload compares them."""
    settings = configured(chefbot, PLANTED)
    assert SECRET not in settings.model_dump_json(by_alias=True)
    assert SECRET not in str(settings.model_dump(mode="json", by_alias=True))
    assert settings.plugins.settings["house"]["mqtt"]["pw"] == SECRET
    assert _plain(settings)["plugins"]["settings"]["house"]["mqtt"]["pw"] == SECRET
    assert Settings.model_validate_json(settings.model_dump_json(by_alias=True)).plugins.allow == ("house",)


def test_texts_of_plugins_are_known_to_the_redactor(chefbot: Path) -> None:
    """Wherever they stand in the settings: a plug-in may have logged one."""
    found = texts_in(configured(chefbot, PLANTED).plugins.settings)
    assert found.count(SECRET) == 2
    assert f"https://ann:{SECRET}@example.org/" in found


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('[api]\ntoken = "{}"', "api.token"),
        ('[api]\npassword = "{}"', "api.password"),
        ('[api]\ntoken_credential = "{} !"', "api.token_credential"),
        ('[mqtt]\npw = "{}"', "mqtt"),
        ('[plugins]\nallow = []\nsettings = "{}"', "plugins.settings"),
        ('[plugins]\nallow = ["house"]\nsettings.house = "{}"', "plugins.settings.house"),
        ('[plugins]\nallow = ["house"]\nsettings.house.x = 2020-01-01\nx = "{}"', "plugins.x"),
    ],
)
def test_what_may_be_a_secret_is_refused_by_its_key_alone(chefbot: Path, text: str, named: str) -> None:
    """The key is named, and what was expected; the value is not."""
    with pytest.raises(SettingsError) as caught:
        configured(chefbot, "\n" + text.replace("{}", SECRET))
    assert named in str(caught.value)
    assert SECRET not in str(caught.value)
