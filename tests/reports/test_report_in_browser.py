"""Reports in a real browser: nothing goes wrong, every figure is drawn, nothing is loaded from anywhere."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from forcegrasp.cli.measuring import write_results
from forcegrasp.reports import comparison as comparison_report
from forcegrasp.reports import diagnosis as diagnosis_report

DRIVER, BROWSER = shutil.which("chromedriver"), shutil.which("chromium") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(
    not (DRIVER and BROWSER), reason="needs Chromium: apt-get install -y chromium chromium-driver"
)

FLAGS = """
--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking
--disable-component-update --disable-sync --disable-dev-shm-usage --window-size=1100,1000
"""
#: Size in pixels of each figure, and how many shapes it is drawn with.
SIZES = """
return [...document.querySelectorAll("figure svg")].map(svg => {
  const box = svg.getBoundingClientRect();
  return [box.width, box.height, svg.querySelectorAll("path, use, text").length, box.right];
});
"""


class Browser:
    """A Chromium, by the WebDriver protocol."""

    def __init__(self, port: int, profile: Path) -> None:
        self._address, self._session = f"http://127.0.0.1:{port}", ""
        options = {"binary": BROWSER, "args": [*FLAGS.split(), f"--user-data-dir={profile}"]}
        wanted = {"goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"}}
        self._session = "/session/" + self.ask("/session", capabilities={"alwaysMatch": wanted})["sessionId"]

    def ask(self, path: str, method: str = "POST", **content: Any) -> Any:
        data = json.dumps(content).encode() if method == "POST" else None
        request = urllib.request.Request(self._address + self._session + path, data, method=method)
        with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(request, timeout=60) as reply:
            return json.load(reply)["value"]

    def messages(self) -> list[str]:
        return [entry["message"] for entry in self.ask("/se/log", type="browser")]

    def requested(self, page: str) -> set[str]:
        """Addresses of everything that a page asked for, itself included; what is in the page is not asked for."""
        events = [json.loads(entry["message"])["message"] for entry in self.ask("/se/log", type="performance")]
        asked = [e["params"] for e in events if e["method"] == "Network.requestWillBeSent"]
        addresses = {params["request"]["url"] for params in asked if params["documentURL"] == page}
        return {address for address in addresses if not address.startswith("data:")}


@pytest.fixture(scope="module")
def browser(tmp_path_factory) -> Iterator[Browser]:
    process = subprocess.Popen([DRIVER, "--port=0"], stdout=subprocess.PIPE, text=True)
    try:
        line = next(line for line in process.stdout if "started successfully" in line)
        browser = Browser(int(re.search(r"port (\d+)", line)[1]), tmp_path_factory.mktemp("profile"))
        yield browser
        browser.ask("", method="DELETE")
    finally:
        process.terminate()
        process.wait()
        process.stdout.close()


@pytest.fixture(params=["compare", "diagnose, one of two", "diagnose, unknown"])
def report(request, made_up, tmp_path) -> Path:
    if request.param == "compare":
        lead = comparison_report.answer(made_up.comparison)
        sections = comparison_report.sections(made_up.comparison, [])
    else:
        diagnosis = made_up.diagnosis("unknown" if "unknown" in request.param else "one_of")
        lead = diagnosis_report.answer(diagnosis)
        sections = diagnosis_report.sections(diagnosis, made_up.advice, made_up.tried)
    name = made_up.loaded.measured.name
    write_results(tmp_path, "x", {}, f"Report of {name}", f"{lead} {name}", sections, made_up.loaded)
    return tmp_path / "report.html"


def test_report(browser, report, made_up):
    browser.ask("/url", url=report.as_uri())
    sizes = browser.ask("/execute/sync", script=SIZES, args=[])
    assert len(sizes) == report.read_text().count("<figure>") >= 4
    for width, height, shapes, right in sizes:
        assert width > 300
        assert height > 80
        assert shapes > 10
        assert right <= 1100
    assert browser.messages() == []
    assert browser.requested(report.as_uri()) == {report.as_uri()}
    text = browser.ask("/execute/sync", script="return document.body.innerText", args=[])
    assert made_up.loaded.measured.name in text
    assert browser.ask("/execute/sync", script="return document.scripts.length", args=[]) == 0
