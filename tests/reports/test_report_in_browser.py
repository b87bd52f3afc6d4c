"""Reports in a real browser: all is drawn, clicks do what they say, nothing goes wrong or is loaded from anywhere."""

from __future__ import annotations

import dataclasses
import json
import re
import shutil
import subprocess
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from forcegrasp.cli.measuring import write_results
from forcegrasp.reports import comparison as comparison_report
from forcegrasp.reports import diagnosis as diagnosis_report
from forcegrasp.reports.diagnosis_box import answer_box
from forcegrasp.reports.next_step import after_comparison, after_diagnosis
from tests.made_up import result_of

DRIVER, BROWSER = shutil.which("chromedriver"), shutil.which("chromium") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(
    not (DRIVER and BROWSER), reason="needs Chromium: apt-get install -y chromium chromium-driver"
)

FLAGS = """
--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking
--disable-component-update --disable-sync --disable-dev-shm-usage --window-size=1100,1000
"""
#: Of each picture that is seen: size in pixels, how many shapes it is drawn with, and where it ends.
SIZES = """
return [...document.querySelectorAll("figure svg, .charts > svg")].map(svg => {
  const box = svg.getBoundingClientRect();
  return [box.width, box.height, svg.querySelectorAll("path, use, text").length, box.right];
}).filter(size => size[0] > 0);
"""
#: What the view shows: the chosen rows and cells, all grasps, and of the traces their titles, times and curves.
SHOWN = """
const text = where => [...document.querySelectorAll(where)].map(node => node.textContent);
return {
  rows: text(".chosen-row th"), pressed: text(".map button[aria-pressed=true]"), names: text(".each tbody th"),
  titles: text(".charts .title"), times: text(".charts > svg:first-child > text").filter(t => t.endsWith(" s")),
  readout: document.querySelector(".readout").textContent,
  paths: document.querySelectorAll(".charts .line:not(.command)").length,
};
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

    def run(self, script: str) -> Any:
        return self.ask("/execute/sync", script=script, args=[])

    def find(self, selector: str) -> dict[str, str]:
        return self.ask("/element", using="css selector", value=selector)

    def click(self, selector: str) -> None:
        self.ask(f"/element/{next(iter(self.find(selector).values()))}/click")

    def drag(self, selector: str, *path: tuple[int, int], press: bool = True) -> None:
        """Moves the mouse along a path, in pixels from an element's middle; with the button pressed from the first."""
        moves = [
            {"type": "pointerMove", "x": x, "y": y, "duration": 50, "origin": self.find(selector)} for x, y in path
        ]
        button = [{"type": f"pointer{way}", "button": 0} for way in ("Down", "Up")] if press else []
        actions = [moves[0], *button[:1], *moves[1:], *button[1:]]
        self.ask("/actions", actions=[{"type": "pointer", "id": "mouse", "actions": actions}])

    def shown(self) -> dict[str, Any]:
        return self.run(SHOWN)

    def size(self, width: int, height: int = 1000) -> None:
        self.ask("/window/rect", width=width, height=height)

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


def write(verb: str, made_up: Any, folder: Path) -> Path:
    """A report of what was made up, with a name in it that does harm wherever it is not escaped."""
    name = made_up.loaded.measured.name
    if verb == "compare":
        box = comparison_report.answer_box(made_up.comparison, [name], after_comparison(made_up.comparison, name, name))
        sections = comparison_report.sections(made_up.comparison, [name])
    else:
        diagnosis = made_up.diagnosis(verb)
        advice = made_up.advice if verb == "one_of" else None
        box = answer_box(diagnosis, advice, after_diagnosis(diagnosis, advice, name, name, name), name)
        sections = diagnosis_report.sections(diagnosis, advice, made_up.tried)
    write_results(folder, result_of(f"Report of {name}", box, sections, made_up.loaded))
    return folder / "report.html"


@pytest.fixture(scope="module")
def diagnosed(made_up, tmp_path_factory) -> Path:
    return write("one_of", made_up, tmp_path_factory.mktemp("diagnosed"))


@pytest.fixture(params=["compare", "one_of", "unknown"])
def report(request, made_up, diagnosed, tmp_path) -> Path:
    return diagnosed if request.param == "one_of" else write(request.param, made_up, tmp_path)


def test_report(browser, report, made_up):
    browser.size(1100)
    browser.ask("/url", url=report.as_uri())
    sizes = browser.run(SIZES)
    replaced = report.read_text().count('<figure class="in-view">')
    assert len(sizes) == report.read_text().count("<figure") - replaced + 2 >= 3
    assert replaced >= 1
    for width, height, shapes, right in sizes:
        assert width > 300
        assert height > 80
        assert shapes > 10
        assert right <= 1100
    assert browser.messages() == []
    assert browser.requested(report.as_uri()) == {report.as_uri()}
    assert made_up.loaded.measured.name in browser.run("return document.body.innerText")
    assert browser.run("return document.scripts.length") == 2


def test_a_click_on_the_map_shows_the_traces_of_its_cell(browser, diagnosed):
    browser.size(1100)
    browser.ask("/url", url=diagnosed.as_uri())
    first = browser.shown()
    assert first["rows"] == ["force left", "g3 on thing 1"]  # the worst, before anyone asks
    assert [title for title in first["titles"] if "[" in title] == ["force left [N]", "position left [mm]"]
    assert first["titles"].count("measured − model, ÷ noise") == 2
    assert first["paths"] == 2 * 2 * 2  # two signals, curves and residuals, without and with the effect
    assert len(first["times"]) > 3
    browser.click(".overview tbody tr:nth-child(2) td:nth-child(3) button")  # position right, first contact
    chosen = browser.shown()
    assert chosen["rows"][0] == "position right"
    assert len(chosen["pressed"]) == 2
    assert chosen["titles"][0] == "position right [mm]"
    assert max(float(time.split()[0]) for time in chosen["times"]) < 4
    browser.click(".each tbody tr:nth-child(6) td:nth-child(5) button")  # g5, hold
    assert browser.shown()["rows"] == ["position right", "g5 on thing 1"]
    assert min(float(time.split()[0]) for time in browser.shown()["times"]) > 1
    assert browser.messages() == []


def test_a_grasp_is_picked_and_zoomed_into(browser, diagnosed, made_up):
    browser.size(1100)
    browser.ask("/url", url=diagnosed.as_uri())
    count = len(made_up.target.grasps)
    browser.click("button[aria-label=next]")
    assert browser.shown()["rows"][1] == "g4 on thing 0"
    browser.click("button[aria-label=previous]")
    browser.click("button[aria-label='zoom in']")
    zoomed = browser.shown()
    assert float(zoomed["times"][0].split()[0]) > 1
    browser.click("button[aria-label='zoom out']")
    assert browser.shown()["times"][0] == "0 s"
    trace = ".charts > svg"
    browser.run("document.querySelector('.charts').scrollIntoView()")
    browser.drag(trace, (-60, -50), (60, -50))
    assert float(browser.shown()["times"][0].split()[0]) > 1
    browser.drag(trace, (0, -50), press=False)
    told = browser.shown()["readout"]
    assert re.match(r"force left, \d\.\d{3} s: measured 0\.\d+ N; base model .* × noise\)", told)
    assert told.count("off by") == 2
    browser.ask("/actions", actions=[])
    browser.run("document.querySelector('.charts > svg').dispatchEvent(new MouseEvent('dblclick'))")
    assert browser.shown()["times"][0] == "0 s"
    assert len(browser.shown()["names"]) == count
    order = browser.shown()["names"]
    browser.click(".bar p + button")  # worst first
    assert browser.shown()["names"][0] == "g3 on thing 1" != order[0]
    # under the model with the effect nothing is left in the same cell
    cell = "return +document.querySelector('.overview tr:nth-child(3) td:nth-child(5) button').textContent"
    before = browser.run(cell)
    browser.click("select[aria-label=model] option:nth-child(2)")
    assert browser.run(cell) < 1.5 < 5 < before
    assert browser.messages() == []


def test_a_report_is_light_or_dark_and_fits_a_phone(browser, diagnosed):
    browser.ask("/url", url=diagnosed.as_uri())
    paper = "return getComputedStyle(document.body).backgroundColor"
    light = browser.run(paper)
    browser.click(".theme")
    assert light == "rgb(255, 255, 255)" != browser.run(paper)
    left = "return [...document.querySelectorAll('.view > div')].map(d => d.getBoundingClientRect().left)"
    assert len(set(browser.run(left))) == 2
    phone = {"width": 360, "height": 740, "deviceScaleFactor": 2, "mobile": True}
    browser.ask("/goog/cdp/execute", cmd="Emulation.setDeviceMetricsOverride", params=phone)
    try:
        browser.ask("/url", url=diagnosed.as_uri())
        assert browser.run("return [innerWidth, document.documentElement.scrollWidth]") == [360, 360]
        assert len(set(browser.run(left))) == 1  # maps stand above the traces
        assert browser.run("return document.querySelector('.charts > svg').getBoundingClientRect().width") > 300
        browser.click(".each tbody tr:nth-child(6) td:nth-child(5) button")
        assert browser.shown()["rows"][1] == "g5 on thing 1"
        top = browser.run("return document.querySelector('.charts').getBoundingClientRect().top")
        assert -1 <= top < 740 - 300  # the traces come into sight
    finally:
        browser.ask("/goog/cdp/execute", cmd="Emulation.clearDeviceMetricsOverride", params={})


def test_a_report_is_read_without_scripts(browser, diagnosed, tmp_path):
    """All static pictures are seen, and nothing that a script would draw."""
    page = diagnosed.read_text().replace("script-src 'sha256-", "script-src 'sha256-other")
    (tmp_path / "without.html").write_text(page)
    browser.ask("/url", url=(tmp_path / "without.html").as_uri())
    assert len(browser.run(SIZES)) == page.count("<figure")
    text = browser.run("return document.body.innerText")
    assert "How sure" in text
    assert "forcegrasp diagnose" in text
    assert "Look at the grasps" not in text
    assert any("Content Security Policy" in message for message in browser.messages())


def test_what_is_not_counted_does_not_flatten_what_is(browser, made_up, tmp_path, monkeypatch):
    monkeypatch.setattr("forcegrasp.reports.html._svg", lambda figure: "")  # it is the view that is looked at
    far = made_up.comparison.predicted.copy()
    far[:, :5] += 1000 * made_up.target.sigma
    highest = {}
    for first_phase in (-1, 0):
        phase = made_up.target.phase.copy()
        phase[:, :5] = first_phase
        target = dataclasses.replace(made_up.target, phase=phase)
        comparison = dataclasses.replace(made_up.comparison, target=target, predicted=far)
        changed = SimpleNamespace(**(vars(made_up) | {"comparison": comparison}))
        browser.ask("/url", url=write("compare", changed, tmp_path / str(first_phase)).as_uri())
        labels = "[...document.querySelectorAll('.charts > svg text[text-anchor=end]')]"
        highest[first_phase] = browser.run(
            f"return Math.max(...{labels}.map(t => Math.abs(parseFloat(t.textContent))))"
        )
    assert highest[-1] < 100 < 500 < highest[0]
