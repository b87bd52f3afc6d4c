"""The page of the campaign: its rates are those of its rows, and it says which code they are of."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict

import pytest

from tools import hidden_effects, hidden_effects_report, measured_code
from tools.hidden_effects import Job


def row(job: Job, verdict: str, effects: tuple[str, ...] = (), after: float = 1.0, **more) -> dict:
    steps = [[verdict, [name]] for name in effects] + [[None, []]]
    return {
        "name": job.name, **asdict(job), "verdict": verdict, "effects": list(effects), "steps": steps, "floor": 1.0,
        "error_before": 3.0, "error_after": after, "left": "", "processor_s": 20.0, "intervals": [], **more,
    }  # fmt: skip


def servo(group: str, hidden: tuple[str, ...], seed: int, size: str = "medium") -> Job:
    return Job(f"servo {group}", hidden, size, seed, "", 0)


NONE = [servo("none", (), k, "") for k in range(4)]
ONE = [servo("one", ("stiction",), k) for k in range(3)] + [servo("one", ("stiction",), 9, "small")]
TWO = [servo("two", ("stiction", "command_delay"), k) for k in range(2)]
CODE = {"commit": "0123456789abcdef+", "digest": "aaaabbbbcccc"}


@pytest.fixture
def page(tmp_path, monkeypatch):
    """``page(rows, jobs, of)``: the page of "grippers" or "servos" as it is written; empty if it is not."""
    monkeypatch.setattr(hidden_effects_report, "DOCS", tmp_path)

    def written(rows: list[dict], jobs: list[Job], of: str = "servos", of_all: bool = False) -> str:
        hidden_effects_report.write(rows, jobs, lambda job: set(job.hidden), of_all)
        file = tmp_path / ("hidden-effects-of-servos.md" if of == "servos" else "hidden-effects.md")
        return file.read_text() if file.exists() else ""

    return written


def test_servos_have_rates_of_their_own(page):
    rows = [
        *(row(job, "explained") for job in NONE[:3]), row(NONE[3], "effect", ("backlash",)),
        row(ONE[0], "effect", ("stiction",)), row(ONE[1], "one_of", ("coulomb_friction", "stiction"), 1.2),
        row(ONE[2], "effect", ("backlash",)), row(ONE[3], "unknown", after=1.05),
        row(TWO[0], "effect", ("command_delay", "stiction")), row(TWO[1], "effect", ("stiction",), 1.5),
    ]  # fmt: skip
    text = page(rows, [*NONE, *ONE, *TWO])
    assert not page(rows, [*NONE, *ONE, *TWO], "grippers")
    for line in (
        '| one effect hidden: right one first, or in a right "one of" set | 2 of 4 (50%; 15–85 %) |',
        "| … strictly first | 1 of 4 (25%; 5–70 %) |",
        "| … small effects, first or in the set | 0 of 1 (0%; 0–79 %) |",
        "| … medium effects, first or in the set | 2 of 3 (67%; 21–94 %) |",
        "| … large effects, first or in the set | – |",
        "| … error left at most 1.1 × the floor | 3 of 4 (75%; 30–95 %) |",
        "| two hidden: both named | 1 of 2 (50%; 9–91 %) |",
        "| … at least one of them | 2 of 2 (100%; 34–100 %) |",
        "| … error left at most 1.1 × the floor | 1 of 2 (50%; 9–91 %) |",
        "| nothing hidden: called explained | 3 of 4 (75%; 30–95 %) |",
        "| nothing hidden: an effect named (false alarm) | 1 of 4 (25%; 5–70 %) |",
        "| further effects named besides those that are hidden | 2 of 6 (33%; 10–70 %) |",
    ):
        assert line in text
    assert "Results of 10 sets (10 in the whole campaign)." in text
    assert text.count("| servo_stiction_medium_s2 | effect | backlash |") == 1


def test_without_a_result_of_servos_their_page_stays_as_it_is(page):
    job = Job("one", ("backlash",), "medium", 1)
    rows, jobs = [row(job, "effect", ("backlash",))], [job, *NONE]
    assert not page(rows, jobs)
    text = page(rows, jobs, "grippers")
    assert "Results of 1 sets (1 in the whole campaign)." in text
    assert "| … strictly first | 1 of 1 (100%; 21–100 %) |" in text


def test_the_page_says_what_a_diagnosis_costs_by_what_was_hidden(page):
    jobs = [Job("one", ("backlash",), "medium", k) for k in range(3)] + [Job("none", (), "", 1)]
    rows = [row(job, "effect", ("backlash",), processor_s=float(20 + 10 * job.seed)) for job in jobs[:3]]
    text = page([*rows, row(jobs[3], "explained", processor_s=7.0)], jobs, "grippers")
    assert "| one effect | 3 | 30 | 38 |" in text
    assert "| nothing | 1 | 7 | 7 |" in text
    assert "a messy rig" not in text.split("What a diagnosis costs")[1].split("##")[0]


def test_ties_and_laws_have_rates_of_their_own(page):
    ties = [Job("tie", ("backlash",), "medium", k, grasps=9, plan="close_and_hold") for k in range(3)]
    left = {
        "proposed": [{"verdict": "effect", "effects": ["backlash"]}],
        "chance": [{"verdict": "one_of", "effects": []}],
    }
    laws = [Job("outside", (name,), "large", 1) for name in ("curved_force_gain", "tip_inertia", "stale_positions")]
    bent = {"place": "force", "expression": "c1 * force * abs(force)", "share": 0.9}
    tied = ("one_of", ("backlash", "adhesion"))
    rows = [
        row(ties[0], *tied, further=left), row(ties[1], *tied, further=left), row(ties[2], "effect", ("backlash",)),
        *(row(job, "unknown", law=bent) for job in laws),
    ]  # fmt: skip
    text = page(rows, [*ties, *laws], "grippers")
    for line in (
        "| one effect, 9 grasps that close and hold: right, or in a right set | 3 of 3 (100%; 44–100 %) |",
        "| … of ties with the right one: it alone is left after two proposed grasps | 2 of 2 (100%; 34–100 %) |",
        "| … after two of the menu by chance | 0 of 2 (0%; 0–66 %) |",
        "| … the library of terms has one for it: a law with that term | 1 of 2 (50%; 9–91 %) |",
        "| nothing hidden, odd noise or not: a law proposed | – |",
    ):
        assert line in text


def test_a_set_that_failed_is_counted_and_not_measured(page):
    failed = {"name": ONE[0].name, **asdict(ONE[0]), "verdict": "error", "error": "no memory"}
    text = page([failed, row(ONE[1], "effect", ("stiction",))], ONE)
    assert "| … strictly first | 1 of 2 (50%; 9–91 %) |" in text
    assert "| … error left at most 1.1 × the floor | 1 of 1 (100%; 21–100 %) |" in text


def test_the_page_is_of_the_code_that_measured_last_and_says_so(page):
    of_both = [row(NONE[0], "explained", **(CODE | {"digest": "earlier"})), row(NONE[1], "explained", **CODE)]
    text = page(of_both, NONE)
    assert "Measured with commit `0123456789ab+`, digest `aaaabbbbcccc`: 1 sets." in text
    assert "earlier" not in text
    assert "Results of 1 sets (4 in the whole campaign)." in text
    assert measured_code.outdated(text, "aaaabbbbcccc") == []
    assert measured_code.outdated(text, "another") == [line for line in text.splitlines() if "aaaabbbbcccc" in line]
    unknown = page([row(NONE[0], "explained", **CODE), row(NONE[2], "explained")], NONE)
    assert measured_code.outdated(unknown, "aaaabbbbcccc") == ["Measured with code that was not noted: 1 sets."]
    assert measured_code.outdated("# a page\n", "x") == ["It does not say which code it measured."]


def test_the_page_may_be_of_all_code_and_is_never_the_present_one_then(page):
    rows = [row(job, "explained", commit="c", digest=f"d{job.seed}") for job in NONE]
    text = page(rows, NONE, of_all=True)
    assert "Results of 4 sets (4 in the whole campaign)." in text
    assert "Measured with 4 versions of the code" in text
    assert measured_code.outdated(text, "d3")
    assert "Measured with commit `c`, digest `d1`: 1 sets." in page(rows[:2], NONE, of_all=True)


def test_the_digest_is_of_each_line_of_the_packages_and_of_no_others(tmp_path):
    for name in (*measured_code.PACKAGES, "reports"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "one.py").write_text("a = 1\n")
    known = {measured_code.digest(tmp_path)}
    (tmp_path / "reports" / "one.py").write_text("a = 2\n")
    assert measured_code.digest(tmp_path) in known
    for name in measured_code.PACKAGES:
        (tmp_path / name / "one.py").write_text("a = 2\n")
        now = measured_code.digest(tmp_path)
        assert now not in known
        known.add(now)
    assert len(measured_code.digest()) == 12


def test_the_check_fails_where_the_page_is_of_other_code(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(hidden_effects, "ROOT", tmp_path)
    monkeypatch.setattr(hidden_effects, "PAGES", (tmp_path / "page.md",))
    monkeypatch.setattr(sys, "argv", ["hidden_effects.py", "check"])
    (tmp_path / "page.md").write_text(measured_code.sentences([measured_code.stamp()])[0])
    assert hidden_effects.main() == 0
    assert capsys.readouterr().out == ""
    (tmp_path / "page.md").write_text(measured_code.sentences([CODE])[0])
    assert hidden_effects.main() == 1
    said = capsys.readouterr().out
    assert "page.md: Measured with commit `0123456789ab+`, digest `aaaabbbbcccc`: 1 sets." in said
    assert "run --renew" in said
    assert "--skip hidden-effects" in said


@pytest.mark.parametrize(("renew", "done"), [(False, {"old", "new"}), (True, {"new"})])
def test_results_are_stamped_and_those_of_other_code_are_renewed_on_demand(tmp_path, monkeypatch, renew, done):
    jobs = [servo("none", (), k, "") for k in range(3)]
    names = dict(zip(("old", "new", "none"), (job.name for job in jobs), strict=True))
    now = measured_code.stamp()
    monkeypatch.setattr(hidden_effects, "RESULTS", tmp_path / "results.jsonl")
    monkeypatch.setattr(hidden_effects, "jobs", lambda: jobs)
    monkeypatch.setattr(hidden_effects, "ProcessPoolExecutor", InThisProcess)
    monkeypatch.setattr(hidden_effects, "run_job", lambda job: row(job, "explained"))
    before = [row(jobs[0], "explained", **CODE), row(jobs[1], "explained", **now)]
    (tmp_path / "results.jsonl").write_text("".join(f"{json.dumps(r)}\n" for r in before))
    hidden_effects.run("", 1, renew)
    added = (tmp_path / "results.jsonl").read_text().splitlines()[2:]
    found = {r["name"]: r for r in map(json.loads, added)}
    assert set(found) == set(names.values()) - {names[one] for one in done}
    assert all({key: r[key] for key in now} == now for r in found.values())
    assert hidden_effects.load_results()[0]["name"] == names["new" if renew else "old"]  # in the order of measuring


class InThisProcess:
    """A pool without processes."""

    def __init__(self, workers: int) -> None: ...

    def __enter__(self) -> InThisProcess:
        return self

    def __exit__(self, *error: object) -> None: ...

    def submit(self, function, job):
        from concurrent.futures import Future

        future: Future = Future()
        future.set_result(function(job))
        return future


def test_what_a_clock_that_is_off_leaves_is_part_of_the_floor(page):
    jobs = [Job("messy", (), "", k, noise="heavy", spoiled="radius_0.3mm") for k in range(3)]
    left = zip(jobs, (1.2, 1.4, 1.2), (0.5, 0.5, 0.0), strict=True)  # floors of 1.118, 1.118 and 1
    rows = [row(job, "explained", after=after, of_jitter=jitter) for job, after, jitter in left]
    text = page(rows, jobs, "grippers")
    begins = text.index("| a messy rig")
    assert "| … error left at most 1.1 × the floor | 1 of 3" in text[begins : begins + 500]
