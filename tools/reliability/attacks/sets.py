"""Measurement sets with links out of their folder, names that are paths or scripts, and files that unpack to much."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import polars as pl

from forcegrasp.cli.main import main
from forcegrasp.deploy.contract_file import read_contract
from forcegrasp.measure import MeasurementSet, check_set, read_set
from forcegrasp.physics import default_gripper
from tools.reliability.attacks.attack import MARK, Attack, not_files, replace

NAMES = [
    "../../outside/x",
    "/etc/passwd",
    "..",
    "~/x",
    "C:\\\\x",
    "<script>document.title='x'</script>",
    "<img src=x onerror=alert(1)>",
    "</svg><script>alert(1)</script>",
    "'><iframe src=javascript:alert(1)>",
    "&lt;script&gt;",
    "{{ 7 * 7 }}",
    "{% include 'report.html' %}",
    "$\\\\frac{1}{0$",
    "[red]x[/blue]",
    "%s%n%(x)s{0}",
    "`touch " + MARK + "`",
    "$(touch " + MARK + ")",
    "=HYPERLINK(1)",
]
META = "format: forcegrasp-measurements/1\nkind: {kind}\ngripper: {gripper}\nsource: {text}\nlicense: {text}\n"
_SAMPLES = ("t_s", "qdes_l_m", "qdes_r_m", "q_l_m", "q_r_m", "f_l_n", "f_r_n")


def _table(name: str) -> None:
    """A table of final forces whose object, source and folder bear a name."""
    folder = Path("a set <b>x")
    folder.mkdir()
    quoted = "'" + name.replace("\\\\", "\\").replace("'", "''") + "'"
    (folder / "meta.yaml").write_text(META.format(kind="final_force", gripper="tiago", text=quoted))
    cell = '"' + name.replace("\\\\", "\\").replace('"', '""') + '"'
    rows = [f"{cell},{0.0002 * k:g},{0.06 * max(0, k - 1) + 0.001 * (-1) ** k:g}" for k in range(1, 11)]
    (folder / "table.csv").write_text("\n".join(["object,delta_q_m,final_force_n", *rows]) + "\n")


def _compare_table(name: str) -> None:
    """Reads the table, writes the report, and looks at it as a browser would."""
    assert main(["compare", "data='a set <b>x'", "out=out/report"]) == 0
    html = Path("out/report/report.html").read_text()
    spoken = name.replace("\\\\", "\\")
    if "<" in spoken and spoken in html:
        raise AssertionError("the name stands in the report as it is")
    if "<b>x" in html or "<script" in html.lower() or "<iframe" in html.lower() or "<img src=x" in html.lower():
        raise AssertionError("the report has elements that a name made")


def _set(gripper: str = "tiago") -> None:
    """A small sound set, but for its gripper's name."""
    Path("meta.yaml").write_text(META.format(kind="grasps", gripper=gripper, text="x"))
    Path("grasps.csv").write_text("grasp,object,session,object_radius_m\ng1,foam,s,0.02\n")
    rows = [f"g1,{k * 0.04:g},0.04,0.04,{0.04 - 1e-4 * k:g},0.04,{0.01 * k:g},0" for k in range(20)]
    Path("samples.csv").write_text("\n".join([",".join(("grasp", *_SAMPLES)), *rows]) + "\n")


def _parquet(make: Callable[[], pl.DataFrame], **how) -> None:
    _set()
    Path("samples.csv").unlink()
    make().write_parquet("samples.parquet", **how)


def _constant(rows: int, name: str = "g1") -> pl.DataFrame:
    columns = [pl.Series("grasp", [name]), *(pl.Series(column, [0.0]) for column in _SAMPLES)]
    return pl.DataFrame([column.new_from_index(0, rows) for column in columns])


def _packed(pack: Callable[[bytes], bytes]) -> None:
    _set()
    data = Path("samples.csv").read_bytes()
    Path("samples.csv").write_bytes(pack(data + b"\n" * 100_000_000))


def _sparse(name: str, size: int) -> None:
    _set()
    with open(name, "r+b") as file:
        file.truncate(size)


def _many_columns() -> None:
    _set()
    Path("samples.csv").write_text(",".join(f"c{n}" for n in range(1_000_000)) + "\n")


def _lying_footer() -> None:
    """Says that it holds a row less in another place than where it is."""
    _parquet(lambda: _constant(1_000_000))
    data = bytearray(Path("samples.parquet").read_bytes())
    start = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    at = data.index(b"\x80\x89\x7a", start)  # a million, as the footer writes it
    data[at : at + 3] = b"\x82\x80\x00"
    Path("samples.parquet").write_bytes(data)


BOMBS: dict[str, Callable[[], object]] = {
    "40 million rows": lambda: _parquet(lambda: _constant(40_000_000), compression="zstd"),
    "a name of 200 kB, 20,000 times": lambda: _parquet(lambda: _constant(20_000, "x" * 200_000), row_group_size=500),
    "100,000 columns": lambda: _parquet(lambda: pl.DataFrame({f"c{n}": [0.0] for n in range(100_000)})),
    "100,000 row groups": lambda: _parquet(lambda: _constant(20_000), row_group_size=1),
    "a footer that lies": _lying_footer,
    "CSV in gzip": lambda: _packed(lambda data: gzip.compress(data, 1)),
    "CSV in zlib": lambda: _packed(lambda data: zlib.compress(data, 0)),
    "CSV in zstd": lambda: _packed(lambda data: b"\x28\xb5\x2f\xfd" + data[:1000]),
    "a hole of 1.9 GB": lambda: _sparse("samples.csv", 1_900_000_000),
    "a hole of 1 TB": lambda: _sparse("samples.csv", 10**12),
    "a hole in meta.yaml": lambda: _sparse("meta.yaml", 10**10),
    "a hole in grasps.csv": lambda: _sparse("grasps.csv", 10**9),
    "a million columns": _many_columns,
}
GRIPPERS = [
    "../outside/secret",
    "/etc/passwd",
    "/dev/zero",
    "/proc/self/environ",
    "~/x",
    ".",
    "x" * 90,
    "tiago/../../x",
]


def _read() -> None:
    measured = read_set(".")
    assert isinstance(measured, MeasurementSet)
    check_set(measured, default_gripper().stroke)


def attacks() -> Iterator[Attack]:
    for name in NAMES:
        yield Attack(f"the name {name}", partial(_table, name), partial(_compare_table, name), False, seconds=30)
    for file in ("samples.csv", "grasps.csv", "samples.parquet"):
        for what, make in not_files():
            yield Attack(f"{file} is {what}", lambda file=file, make=make: (_set(), replace(Path(file), make)), _read)
        for target in ("../outside/secret", "/etc/passwd"):
            yield Attack(
                f"{file} is a link to {target}",
                lambda file=file, target=target: (_set(), replace(Path(file), lambda path: path.symlink_to(target))),
                _read,
            )
    for what, bomb in BOMBS.items():
        yield Attack(what, bomb, _read, seconds=20)
    for gripper in GRIPPERS:
        yield Attack(f"gripper: {gripper}", partial(_set, gripper), lambda: _command("compare", "data=.", "out=out"))
    for file in ("contract.json", "policy.onnx"):
        for what, make in not_files():
            yield Attack(f"{file} is {what}", partial(_exported, file, make), lambda: read_contract(Path()))
    for text in (
        "[" * 100_000,
        '{"a":' * 100_000,
        "9" * 5000,
        "NaN",
        '{"format": "forcegrasp-policy/1"}',
        '{"format": "forcegrasp-policy/2"}',
        " " * 2_000_000,
    ):
        yield Attack(
            f"contract.json: {text[:9]}", partial(Path("contract.json").write_text, text), lambda: read_contract(".")
        )


def _exported(file: str, make: Callable[[Path], object]) -> None:
    Path("contract.json").write_text('{"format": "forcegrasp-policy/1", "network": {"sha256": "0"}, "control": {}}')
    replace(Path(file), make)


def _command(*arguments: str) -> None:
    """Runs a verb, which is expected to refuse its input."""
    from forcegrasp.errors import ForcegraspError

    if main(list(arguments)) == 2:
        raise ForcegraspError("refused")
