"""A phone is let in by an invitation, in a real browser before the real program."""

from typing import Any

import pytest

from tests.scenarios.page.browser import NEEDS_BROWSER, RunningRobot, barriers, mode_is, show, sync_api

pytestmark = [pytest.mark.slow, pytest.mark.realtime, NEEDS_BROWSER]
TOKEN = "a" * 32
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_an_administrator_lets_a_phone_in_and_out_again(
    browser: Any, page: Any, tmp_path: Any, scheme: str
) -> None:
    """The phone opens the scanned link and touches *Come in*: two touches; its tab may be closed; revoked it is out."""
    state = f'\n[invitations]\nenabled = true\nfolder = "{tmp_path}/invitations"\n'
    robot = RunningRobot(tmp_path, token=TOKEN, more=state)
    phone = browser.new_context(**PHONE, color_scheme=scheme)
    try:
        page.emulate_media(color_scheme=scheme)
        page.goto(robot.url)
        page.locator("#token").fill(TOKEN)
        page.locator("#token").press("Enter")
        show(page, "people")
        page.get_by_role("button", name="Make an invitation").click()
        sync_api.expect(page.locator("#invite-qr")).to_be_visible()
        assert barriers(page) == []
        with robot.client() as admin:
            link = admin.call("make_invitation", role="guest")["link"]
            tab = phone.new_page()
            tab.goto(link)
            sync_api.expect(tab).to_have_url(robot.url)  # the secret is not left in the address
            assert barriers(tab) == []
            assert tab.locator("#estop").is_visible()
            tab.get_by_role("button", name="Come in").tap()
            sync_api.expect(tab.locator("#role")).to_have_text("order and stop")
            sync_api.expect(tab.locator("#login")).to_be_hidden()
            sync_api.expect(tab.locator("#view")).to_be_visible()
            for title in (
                "Drive",
                "Let a phone in",
                "Lately",
                "Wheels",
                "Calibration",
            ):  # programs, map and stop alone
                sync_api.expect(tab.get_by_role("heading", name=title, exact=True)).to_be_hidden()
            tab.close()
            again = phone.new_page()
            again.goto(robot.url)
            sync_api.expect(again.locator("#role")).to_have_text("order and stop")
            other = phone.browser.new_context().new_page()
            other.goto(link)
            other.get_by_role("button", name="Come in").click()
            sync_api.expect(other.locator("#login-told")).to_contain_text("is not open")
            page.get_by_role("button", name="Revoke: browser").or_(
                page.get_by_role("button", name="Revoke: Linux")
            ).click()
            sync_api.expect(again.locator("#login-told")).to_contain_text("does not know this token")
            assert admin.call("list_invitations")["devices"] == []
    finally:
        phone.close()
        robot.end()


def test_a_code_is_typed_and_somebody_approves(browser: Any, tmp_path: Any) -> None:
    """The phone says that it waits, and is in as soon as *Let in* is pressed."""
    state = f'\n[invitations]\nenabled = true\nfolder = "{tmp_path}/invitations"\n'
    robot = RunningRobot(tmp_path, token=TOKEN, more=state)
    phone = browser.new_context(**PHONE)
    try:
        with robot.client() as admin:
            made = admin.call("make_invitation", role="drive", approval=True)
            tab = phone.new_page()
            tab.goto(robot.url)
            tab.locator("#token").fill(made["code"].lower())
            tab.get_by_role("button", name="Log in").tap()
            sync_api.expect(tab.locator("#login-told")).to_contain_text("Wait")
            admin.call("approve_invitation", invitation=made["invitation"])
            mode_is(tab, "Ready to drive")
            sync_api.expect(tab.locator("#role")).to_have_text("drive")
    finally:
        phone.close()
        robot.end()
