"""A server with a login lets nobody in without one, by any of its addresses, and who logs in has the whole page."""

import asyncio
import http.client
import json
import re
from urllib.parse import urlsplit

import pytest
from axe_playwright_python.sync_playwright import Axe
from tornado.httpclient import HTTPClientError, HTTPRequest
from tornado.websocket import websocket_connect

from tests.app.test_browser import ARTEFACTS, button, picture, serving, start_from_truth, visiting
from tests.app.test_browser import pytestmark as pytestmark


@pytest.fixture(scope="module")
def guarded(tmp_path_factory, shelf):
    """The address of a server whose only visitor is ada, and its log."""
    folder = tmp_path_factory.mktemp("guarded")
    users = folder / "users.json"
    users.write_text(json.dumps({"ada": "counts & more"}))
    options = (
        "--basic-auth",
        str(users),
        "--basic-login-template",
        "app/login.html",
        "--logout-template",
        "app/logout.html",
    )
    with serving(folder / "log", shelf, *options, PANEL_COOKIE_SECRET="only-of-this-test") as address:
        yield address, folder / "log"


def asked(address, path):
    """The status and the address that one is led to."""
    there = http.client.HTTPConnection(urlsplit(address).netloc, timeout=60)
    there.request("GET", path)
    answer = there.getresponse()
    there.close()
    return answer.status, answer.getheader("Location", "")


def test_who_logs_in_has_the_page_and_what_it_hands_over(guarded):
    with visiting(*guarded) as page:
        page.get_by_label("Name").fill("ada")
        page.get_by_label("Password").fill("wrong")
        page.get_by_role("button", name="Log in").click()
        page.get_by_text("Invalid username or password").wait_for()
        found = Axe().run(page).response["violations"]
        assert [finding["id"] for finding in found if finding["impact"] in ("serious", "critical")] == []
        page.screenshot(path=ARTEFACTS / "login.png")
        page.get_by_label("Name").fill("ada")
        page.get_by_label("Password").fill("counts & more")
        page.get_by_role("button", name="Log in").click()
        picture(page, "Depth image").wait_for()
        start_from_truth(page)
        button(page, "Export").click()
        with page.expect_download() as download:
            button(page, "Track CSV").click()
        assert download.value.suggested_filename.endswith(".csv")
        page.goto(guarded[0].replace("/app", "/logout"))
        page.get_by_text("You are logged out").wait_for()
        page.goto(guarded[0])
        page.get_by_label("Password").wait_for()


# After the page, whose log is to be clean: Panel answers autoload.js rightly, but then complains about it.


@pytest.mark.parametrize(
    "path",
    ["/app", "/app?session=open-close", "/app/autoload.js?bokeh-autoload-element=x", "/app/metadata", "/"],
)
def test_without_a_login_every_address_leads_to_it_or_tells_nothing(guarded, path):
    status, leads_to = asked(guarded[0], path)
    assert (status == 302 and re.match(r"\.?/login\?next=", leads_to)) or status in (403, 404)


def test_without_a_login_the_websocket_is_refused(guarded):
    async def connect():
        url = guarded[0].replace("http", "ws") + "/ws"
        request = HTTPRequest(url, headers={"Origin": guarded[0].removesuffix("/app")})
        await websocket_connect(request, subprotocols=["bokeh", "made-up-token"])

    with pytest.raises(HTTPClientError) as refused:
        asyncio.run(connect())
    assert refused.value.code in (401, 403)
