"""Puts a trained policy into the package, with a card that says what it is and how well it does.

    python tools/ship_policy.py RUN_DIR NAME EVALUATION_DIR "what it is, in a sentence"

The evaluation must be one in which the run took part under its folder's name: `forcegrasp evaluate plan=paper ...`.
"""

from __future__ import annotations

import json
import shlex
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

from forcegrasp.runs.policy import load_policy
from forcegrasp.runs.run_dir import RunDir

POLICIES = Path(__file__).resolve().parent.parent / "forcegrasp" / "policies"


def ship(source: Path, name: str, evaluation: Path, what: str, into: Path = POLICIES, more: Iterable[str] = ()) -> None:
    """Writes ``forcegrasp/policies/NAME``: the policy's weights alone, its config, and its card.

    Args:
      into: folder of the policies.
      more: lines at the end of the card.
    """
    run, folder = RunDir.open(source), into / name
    report = json.loads((evaluation / "evaluation.json").read_text())
    figures = report["policies"][source.resolve().name]
    tensors, facts = run.load()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    shutil.copy(run.config_path, folder / "config.yaml")
    shipped = RunDir(folder)
    shipped.checkpoints.mkdir()
    policy = {key: value for key, value in tensors.items() if key.startswith("policy.")}
    shipped.save(facts["frames"], policy, {"batches": facts["batches"]}, keep=1)
    made = json.loads((source / "run.json").read_text())
    card = _card(name, what, made, facts["frames"], report, figures)
    (folder / "card.md").write_text(card + "".join(f"\n{line}\n" for line in more))
    load_policy(str(folder))
    print(f"shipped {folder}")


def _card(name: str, what: str, made: dict, frames: int, report: dict, figures: dict) -> str:
    def cell(key: str, digits: int, scale: float = 1.0) -> str:
        mean, std, *quantiles = (scale * figures[key][name] for name in ("mean", "std", "median", "p95"))
        return " | ".join([f"{mean:.{digits}f} ± {std:.{digits}f}", *(f"{q:.{digits}f}" for q in quantiles)])

    rows = {
        "force reward, normalised form (150 at best)": cell("force_reward_normalised", 1),
        "force reward, paper's form (150 at best)": cell("force_reward_paper", 1),
        "object moved until both fingers touch [mm]": cell("displacement_until_grasped_mm", 3),
        "object moved in all [mm]": cell("displacement_total_mm", 3),
        "peak force [N]": cell("peak_force_n", 3),
        "overshoot over the goal force [N]": cell("overshoot_n", 3),
        "overshoot over the goal force [%]": cell("overshoot_percent", 1),
        "impact impulse beyond the goal [mN s]": cell("impact_impulse_ns", 2, 1e3),
        "time to the goal force, ± 2 σ_f [s]": cell("reach_s", 2),
        "time from which the force stays there [s]": cell("settled_s", 2),
        "force error over the last second [mN]": cell("final_force_error_n", 1, 1e3),
        "difference between the fingers over the last second [mN]": cell("final_force_difference_n", 1, 1e3),
        "crushed: beyond 1.5 × the goal for more than 40 ms [% of grasps]": cell("crushed_percent", 1),
        "lost: not held throughout the last second [% of grasps]": cell("lost_percent", 1),
    }
    versions = ", ".join(f"{package} {version}" for package, version in made["versions"].items())
    command = shlex.join(part for part in made["command"] if not part.startswith("hydra."))
    return "\n".join(
        [
            f"# {name}",
            "",
            what,
            "",
            f"Trained for {frames:,} frames with seed {made['seed']}; the rest is in `config.yaml`. Train it again:",
            "",
            f"    {command}",
            "",
            f"Evaluated on {len(report['cells'])} × {report['trials']} grasps (by {report['what']}), physics"
            f" `{report['physics']}`, {'model `' + report['model'] + '`, ' if report['model'] else ''}seed"
            f" {report['seed']}:",
            "",
            "| | mean ± standard deviation | median | 95th percentile |",
            "|---|---|---|---|",
            *(f"| {label} | {value} |" for label, value in rows.items()),
            "",
            f"Made with Python {made['python']}, {versions}.",
            "",
        ]
    )


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    ship(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]), sys.argv[4])
