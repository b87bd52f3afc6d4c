"""Pictures and numbers of docs/physics.md: how the contact gives way, and how the floor holds the object back.

    python tools/physics_figures.py [--out docs/figures] [--page docs/physics.md]

Everything is simulated anew, in about ten seconds; the table is written into the page between its marks.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from paper_figures import KAPPAS, ROOT, into_page, table

from forcegrasp.calibration import close
from forcegrasp.calibration.figures import COLOURS
from forcegrasp.physics import GraspParameters, GraspSimulator, default_gripper

RADIUS_M = 0.025
#: Commanded deltas of the squeezes, up to the largest; the third and the last are in the table.
DELTAS_M = np.linspace(0.0001, 0.003, 30)
#: Forces that push the object along the grasp axis; with more it reaches a finger too soon.
PUSHES_N = np.linspace(0.1, 0.6, 6)
#: Seconds in which the object settles, and in which it is pushed; the speed is that of the second half.
SETTLE_S, PUSH_S = 0.8, 0.4


def impedance(depth_m: np.ndarray, rho_m: float) -> np.ndarray:
    """MuJoCo's impedance d over penetration, for solimp (0, 0.99, ρ, 0.5, 2): two parabolas, then constant."""
    x = np.clip(depth_m / rho_m, 0, 1)
    return 0.99 * np.where(x < 0.5, 2 * x**2, 1 - 2 * (1 - x) ** 2)


def squeezes() -> tuple[np.ndarray, np.ndarray]:
    """How deep a pad sinks in at rest, metres, and what a finger reads with f_α = 1, newtons; each ``(κ, Δq)``."""
    n = len(DELTAS_M)
    values = {
        "rho_m": np.repeat(default_gripper().training.at("rho_m", KAPPAS), n),
        "radius_m": RADIUS_M,
        "force_scale": 1.0,
    }
    closing = close(np.tile(DELTAS_M, len(KAPPAS)), 6.0, values, start_m=RADIUS_M + 0.001)
    shape = (len(KAPPAS), n)
    return RADIUS_M - closing.final_position_m.reshape(shape), closing.final_force_n.reshape(shape)


def pushes() -> tuple[np.ndarray, np.ndarray]:
    """Speed of the pushed object, m/s, ``(κ, forces)``, and how deep it has sunk into the floor, metres, ``(κ,)``."""
    simulator = GraspSimulator(len(KAPPAS), threads=1)
    simulator.reset(GraspParameters(KAPPAS, -9.0, RADIUS_M, 0.0, 0.5))  # pyright: ignore[reportArgumentType]
    speed, sunk = np.zeros((len(KAPPAS), len(PUSHES_N))), np.zeros(len(KAPPAS))
    for row in range(len(KAPPAS)):
        for column, force in enumerate(PUSHES_N):
            model, data = simulator.scene(row)
            mujoco.mj_step(model, data, round(SETTLE_S / model.opt.timestep))
            sunk[row] = 0.05 - data.body("object").xpos[2]
            data.xfrc_applied[model.body("object").id, 1] = force
            half = round(PUSH_S / 2 / model.opt.timestep)
            mujoco.mj_step(model, data, half)
            before = data.body("object").xpos[1]
            mujoco.mj_step(model, data, half)
            speed[row, column] = (data.body("object").xpos[1] - before) / (PUSH_S / 2)
    return speed, sunk


def draw_contact(depth: np.ndarray, force: np.ndarray) -> Figure:
    """Impedance by ρ, and what the rig measured."""
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    reach = np.linspace(0, 0.011, 300)
    for row, rho in enumerate(default_gripper().training.at("rho_m", KAPPAS)):
        colour = COLOURS[row]
        left.plot(1e3 * reach, impedance(reach, rho), color=colour, label=f"ρ = {1e3 * rho:.3g} mm")
        right.plot(1e3 * depth[row], force[row], ".-", ms=4, lw=1, color=colour)
    left.set_ylabel("impedance d")
    right.set_ylabel("force f with $f_\\alpha$ = 1 [N]")
    left.set_xlabel("penetration [mm]")
    right.set_xlabel("penetration of the pads at rest [mm]")
    left.legend(frameon=False, fontsize=9)
    tidy(left)
    tidy(right)
    figure.suptitle("The contact by ρ: what is set, and what comes of it", fontsize=11)
    return figure


def draw_floor(speed: np.ndarray, drag: np.ndarray) -> Figure:
    """Speed over push, by κ."""
    figure = Figure(figsize=(5.6, 3.4), layout="constrained")
    axes = figure.subplots()
    for row, (kappa, c) in enumerate(zip(KAPPAS, drag, strict=True)):
        axes.plot(PUSHES_N, 1e3 * speed[row], "o", ms=4, color=COLOURS[row], label=f"κ = {kappa:g}: {c:.0f} N·s/m")
        axes.plot([0, PUSHES_N[-1]], [0, 1e3 * PUSHES_N[-1] / c], lw=1, color=COLOURS[row])
    axes.axhline(1.25, color="0.5", ls=":", lw=1)
    axes.text(PUSHES_N[-1], 1.4, "penalised above", ha="right", va="bottom", fontsize=8, color="0.4")
    axes.set_xlabel("force on the object [N]")
    axes.set_ylabel("speed of the object [mm/s]")
    axes.legend(frameon=False, fontsize=9)
    tidy(axes)
    figure.suptitle("The floor's drag by κ", fontsize=11)
    return figure


def tidy(axes: Axes) -> None:
    """Axes that start at 0, after all is drawn."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25)
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "figures")
    parser.add_argument("--page", type=Path, default=ROOT / "docs" / "physics.md", help="where the table is kept")
    options = parser.parse_args()
    (depth, force), (speed, sunk) = squeezes(), pushes()
    drag = (PUSHES_N @ PUSHES_N) / (speed @ PUSHES_N)  # least squares through 0
    for name, figure in (("contact", draw_contact(depth, force)), ("floor", draw_floor(speed, drag))):
        figure.savefig(options.out / f"physics_{name}.png", dpi=110, metadata={"Software": ""})
    scale = default_gripper().training.force_scale(KAPPAS)
    rho = default_gripper().training.at("rho_m", KAPPAS)
    slope = scale[:, None] * np.gradient(force, axis=1) / np.gradient(1e3 * depth, axis=1)
    rows = [
        f"{k:g} | {1e3 * r:.2f} | {a:g} | {d[2]:.2f}, {d[-1]:.2f} | {s[2]:.2f}, {s[-1]:.1f} | {1e3 * z:.1f} | {c:.0f}"
        for k, r, a, d, s, z, c in zip(KAPPAS, rho, scale, 1e3 * depth, slope, sunk, drag, strict=True)
    ]
    head = (
        "κ | ρ [mm] | f_α | pads sink in at Δq = 0.3, 3 mm [mm] | slope of the reading there [N/mm]"
        " | object sinks into the floor [mm] | floor's drag c [N·s/m]"
    )
    text = table(head, rows)
    print(text)
    if options.page.is_file():
        into_page(options.page, "contact", text)


if __name__ == "__main__":
    main()
