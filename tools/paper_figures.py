"""Every figure and table of the paper that needs no robot, drawn from this project: one command.

    python tools/paper_figures.py [--only NAME ...] [--out docs/figures] [--page docs/calibration.md]

The calibrations of the appendix are simulated anew; their numbers are printed, and written into the page between its
marks. Box plots by softness (Fig. 2, left) and rewards are drawn by `forcegrasp evaluate`; the twenty final forces of
the robot are in docs/real-table.md.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from real_table import FORCE_N, SECOND

from forcegrasp.calibration import (
    closing_speed,
    contact_slope,
    match_force_scale,
    power_grasps,
    staircase,
    vary_kappa,
    vary_rho,
)
from forcegrasp.calibration.figures import COLOURS, draw_power_grasps, draw_presses, draw_staircase
from forcegrasp.calibration.power_grasp import PAPER_B2
from forcegrasp.calibration.staircase import PAPER_SLOPES_N_M
from forcegrasp.config import TrainConfig
from forcegrasp.physics import default_gripper
from forcegrasp.physics.completion import complete
from forcegrasp.physics.sampling import offset_limits_m

ROOT = Path(__file__).resolve().parent.parent
#: A figure, and a table of its numbers in Markdown; either may be missing.
Drawn = tuple[Figure | None, str]
KAPPAS = np.linspace(0, 1, 5)
#: A smaller delta, to show that the slope of a press depends on it.
SLOWLY_M = 0.001
#: Pictures of the scene: how many, height, width, colours.
PICTURES = (2, 480, 640, 3)
BLUE, ORANGE, GREEN = COLOURS[0], COLOURS[4], COLOURS[2]


def act_var() -> Drawn:
    """Appendix, variation of b₂: how fast the fingers close at full action."""
    closing = power_grasps(PAPER_B2)
    speeds = 1e3 * closing_speed(closing)
    figure = draw_power_grasps(closing, [f"b₂ = {b2:g}: {s:.1f} mm/s" for b2, s in zip(PAPER_B2, speeds, strict=True)])
    figure.suptitle("Power grasps at full action, by b₂ (paper: variation of b₂)", fontsize=11)
    on_object = 1e3 * closing_speed(power_grasps(PAPER_B2, radius_m=0.025))
    rows = [f"{b2:g} | {s:.1f} | {o:.1f}" for b2, s, o in zip(PAPER_B2, speeds, on_object, strict=True)]
    return figure, table("b₂ | closing speed, nothing in between [mm/s] | onto an object of 25 mm [mm/s]", rows)


def solimp_var() -> Drawn:
    """Appendix, variation of ρ: ∂f/∂q changes, the final force does not."""
    rho = np.linspace(*default_gripper().training.softness["rho_m"], 5)
    closing, slowly = vary_rho(rho), vary_rho(rho, delta_m=SLOWLY_M, seconds=5.0)
    figure = draw_presses(closing, [f"ρ = {1e3 * r:.3g} mm" for r in rho])
    figure.suptitle("Pressing at full action with $f_\\alpha$ = 1, by ρ (paper: variation of ρ)", fontsize=11)
    rows = [
        f"{1e3 * r:.2f} | {fast:.0f} | {slow:.0f} | {f:.3f}"
        for r, fast, slow, f in zip(
            rho, contact_slope(closing), contact_slope(slowly), closing.final_force_n, strict=True
        )
    ]
    return figure, table("ρ [mm] | ∂f/∂q at Δq = 3 mm [N/m] | at Δq = 1 mm [N/m] | f(T) at 3 mm [N]", rows)


def fscale_var() -> Drawn:
    """Appendix, variation of κ: ∂f/∂q and the final force change together."""
    closing = vary_kappa(KAPPAS)
    figure = draw_presses(closing, [f"κ = {k:g}" for k in KAPPAS])
    figure.suptitle("Pressing at full action, by κ (paper: variation of κ)", fontsize=11)
    numbers = zip(
        KAPPAS,
        default_gripper().training.force_scale(KAPPAS),
        contact_slope(closing),
        closing.final_force_n,
        strict=True,
    )
    return figure, table(
        "κ | f_α | ∂f/∂q at Δq = 3 mm [N/m] | f(T) [N]",
        [f"{k:g} | {a:g} | {s:.0f} | {f:.3f}" for k, a, s, f in numbers],
    )


def stiffness() -> Drawn:
    """Appendix, comparison of final forces: regression of f(T) on Δq, and the f_α that matches the robot's slopes."""
    stairs, scales = staircase(KAPPAS), default_gripper().training.force_scale(KAPPAS)
    unit = staircase(values={"force_scale": 1.0}).slopes[0].n_per_m
    robot = {name: (stairs.delta_m, FORCE_N[SECOND, name], slope) for name, slope in PAPER_SLOPES_N_M.items()}
    figure = draw_staircase(
        stairs, [f"κ = {k:g}, $f_\\alpha$ = {a:g}" for k, a in zip(KAPPAS, scales, strict=True)], robot
    )
    figure.suptitle("Staircases of final forces (paper: final forces of sponge and wood)", fontsize=11)
    rows = [
        f"simulator, κ {k:g} | {s.n_per_m:.1f} [{s.low:.1f}, {s.high:.1f}] | {1e3 * s.offset_n:.1f} | {a:g} | {k:g}"
        for k, a, s in zip(KAPPAS, scales, stairs.slopes, strict=True)
    ]
    for name, slope in PAPER_SLOPES_N_M.items():
        scale = float(match_force_scale(slope, unit))
        kappa = float(default_gripper().training.kappa_of_force_scale(scale))
        rows.append(f"robot, {name} | {slope:.0f} | – | **{scale:.2f}** | **{kappa:.2f}**")
    return figure, table("object | slope of f(T) [N/m] | offset [mN] | f_α | κ", rows)


def schematic() -> Drawn:
    """Fig. 1, schematic overview: what is sampled, and the constraints on it (eqs. 1-3)."""
    figure = Figure(figsize=(8.5, 7), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=(1.2, 1))
    draw_gripper(above)
    draw_constraints(below)
    figure.suptitle("Sampled geometry (paper: Fig. 1, schematic; eqs. 1-3)", fontsize=11)
    return figure, ""


def draw_gripper(axes: Axes) -> None:
    """The open gripper from above, millimetres, with an object off the middle."""
    open_mm, radius, offset, squeeze = 1e3 * default_gripper().stroke, 20.0, 7.0, 6.0
    for side in (-1, 1):
        axes.add_patch(Rectangle((side * open_mm, -14), side * 6, 28, color="0.35"))
        axes.plot([side * (open_mm + 4.5)] * 2, [0, 34], color="0.35", lw=6, solid_capstyle="butt")
    axes.plot([-open_mm - 5.7, open_mm + 5.7], [34, 34], color="0.35", lw=6, solid_capstyle="butt")
    axes.add_patch(Circle((offset, 0), radius, fc="#f3dcc0", ec=COLOURS[3], lw=1.5))
    axes.add_patch(Circle((offset, 0), radius - squeeze, fc="none", ec=COLOURS[3], ls="--", lw=1))
    axes.axhline(0, color="0.6", lw=0.8, ls=":")
    axes.plot([0, 0], [-30, 5], color="0.6", lw=0.8, ls=":")
    for x, name in ((0.0, "W"), (offset, "O")):
        axes.plot(x, 0, "k+", ms=9)
        axes.text(x - 1.5, 1.0, name, ha="right", fontsize=11)
    for start, end, text, at in (
        ((0, -27), (-open_mm, -27), r"$q_{left} = q^{max} = 45$ mm", (-open_mm / 2, -31)),
        ((0, -27), (open_mm, -27), r"$q_{right} = q^{max}$", (open_mm / 2, -31)),
        ((0, -6), (offset, -6), r"$o_y$", (offset / 2, -10)),
        ((offset, 0), (offset + radius * 0.6, radius * 0.8), r"$r_o$", (offset + 4.0, 9.5)),
        ((offset + radius - squeeze, 0), (offset + radius, 0), r"$d_p / 2$", (offset + radius + 6, 1.5)),
    ):
        axes.annotate("", end, start, arrowprops={"arrowstyle": "<->", "lw": 1, "shrinkA": 0, "shrinkB": 0})
        axes.text(*at, text, ha="center", va="center" if at[1] < 1 else "bottom", fontsize=11)
    axes.set_xlim(-56, 56)
    axes.set_ylim(-33, 37)
    axes.set_aspect("equal")
    axes.set_axis_off()


def draw_constraints(axes: Axes) -> None:
    """Offsets that are allowed by radius, millimetres."""
    config = complete(TrainConfig().grasp, default_gripper())
    depth, (low, high) = config.deformation_m, config.radius_m
    radii = np.linspace(depth, 0.040, 400)
    sampled = radii[(radii >= low) & (radii <= high)]
    limit = 1e3 * offset_limits_m(default_gripper(), sampled, depth)[1]
    axes.fill_between(1e3 * sampled, -limit, limit, color="#cfe5f2", label="sampled")
    for sign in (1, -1):
        name = {1: "", -1: "_"}[sign]  # a name that begins with _ is left out of the legend
        inside, within = sign * 1e3 * (default_gripper().stroke - radii), sign * 1e3 * (radii - depth)
        axes.plot(1e3 * radii, inside, color=ORANGE, label=name + r"$|o_y| + r_o < q^{max}$ (1)")
        axes.plot(1e3 * radii, within, color=BLUE, label=name + r"$r_o - d_p > |o_y|$ (2)")
    axes.axvline(1e3 * depth, color=GREEN, ls="--", label=rf"$d_p = {1e3 * depth:g}$ mm $< r_o$ (3)")
    axes.set_xlim(11, 40)
    axes.set_ylim(-30, 30)
    axes.set_xlabel(r"object radius $r_o$ [mm]")
    axes.set_ylabel(r"offset $o_y$ [mm]")
    axes.legend(frameon=False, fontsize=9, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    axes.spines[["top", "right"]].set_visible(False)


def curriculum() -> Drawn:
    """Table 2: annealed parameters, initial and final, and how they run in between."""
    from forcegrasp.curriculum.schedule import LinearSchedule  # here: torch takes seconds, and few figures need it

    config = TrainConfig()
    schedule = LinearSchedule(config.curriculum, config.grasp, config.reward, config.ppo.total_frames)
    frames = np.linspace(0, config.ppo.total_frames, 200)
    values = [schedule(int(f)) for f in frames]
    figure = Figure(figsize=(9, 4.6), layout="constrained")
    grid = figure.subplots(2, 2, sharex=True)
    x = 1e-6 * frames
    grid[0, 0].plot(x, [v.object_weight for v in values], color=BLUE)
    grid[0, 1].plot(x, [1e3 * v.speed_threshold_m for v in values], color=BLUE)
    for axes, key in ((grid[1, 0], "radius_m"), (grid[1, 1], "offset_m")):
        low, high = (1e3 * np.array([getattr(v, key)[k] for v in values]) for k in (0, 1))
        axes.fill_between(x, low, high, color="#cfe5f2")
        axes.plot(x, low, color=BLUE)
        axes.plot(x, high, color=BLUE)
    names = ("weight α₂", "speed threshold\n[mm per step]", "radius W_o [mm]", "offset O_y [mm]")
    for axes, name in zip(grid.ravel(), names, strict=True):
        axes.set_ylabel(name)
        axes.axvline(1e-6 * schedule.end_frames, color="0.6", lw=1, ls=":")
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_xlim(0, 1.02 * x[-1])
        axes.set_ylim(bottom=0 if name != names[3] else None)
    for axes in grid[1]:
        axes.set_xlabel("million frames")
    figure.suptitle("Annealed parameters (paper: Table 2); dotted: end of the curriculum", fontsize=11)
    first, last = schedule(0), schedule(config.ppo.total_frames)
    rows = [
        f"α₂ | {first.object_weight:g} | {last.object_weight:g}",
        f"velocity threshold [m per control step] | {first.speed_threshold_m:g} | {last.speed_threshold_m:g}",
        *(
            f"{name} [m] | [{a[0]:.3f}, {a[1]:.3f}] | [{b[0]:.3f}, {b[1]:.3f}]"
            for name, a, b in (("W_o", first.radius_m, last.radius_m), ("O_y", first.offset_m, last.offset_m))
        ),
    ]
    return figure, table("parameter | initial | final", rows)


def reward() -> Drawn:
    """Eq. 8: the force reward as printed, and in the form that the authors' code divides by the goal."""
    import torch

    from forcegrasp.env.reward import force_reward, normalised_force_reward

    total = torch.linspace(0, 2, 201, dtype=torch.float64)
    error = torch.stack([total / 2, total / 2], dim=-1)
    figure = Figure(figsize=(6.6, 4), layout="constrained")
    axes = figure.subplots()
    axes.plot(total, force_reward(error)[:, 0], color="black", lw=2, label="1 − tanh(Σ|Δf|), as printed")
    for goal, colour in zip((0.1, 0.3, 0.6, 1.2), (BLUE, GREEN, COLOURS[3], ORANGE), strict=True):
        form = normalised_force_reward(error, torch.full((201, 1), goal, dtype=torch.float64))
        axes.plot(total, form[:, 0], color=colour, label=f"Σ|Δf| divided by a goal of {goal:g} N")
        nothing = float(force_reward(torch.tensor([[goal, goal]], dtype=torch.float64)))
        if 2 * goal <= 2:
            axes.plot(2 * goal, nothing, "o", color=colour, ms=6)
    axes.plot([], [], "o", color="0.5", label="doing nothing, as printed: Σ|Δf| is twice the goal")
    axes.set_xlabel("Σ|Δf| [N]")
    axes.set_ylabel("force reward per step")
    axes.set_xlim(0, 2)
    axes.set_ylim(0, 1.02)
    axes.legend(frameon=False, fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    figure.suptitle("Force reward in both forms (paper: eq. 8)", fontsize=11)
    return figure, ""


def bias() -> Drawn:
    """Eq. 7: the inductive bias φ by contact state."""
    import torch

    from forcegrasp.transforms.inductive_bias import contact_bias

    config, goal = TrainConfig().action, 0.5
    force = torch.linspace(0, 2 * goal, 401, dtype=torch.float64)
    figure = Figure(figsize=(6.6, 3.6), layout="constrained")
    axes = figure.subplots()
    states = ((0, 0), "no contact yet"), ((1, 0), "this finger touches, the other not"), ((1, 1), "both touch")
    for (state, name), colour in zip(states, (BLUE, ORANGE, GREEN), strict=True):
        had = torch.tensor(state, dtype=torch.float64).expand(401, 2)
        error = (goal - force)[:, None].expand(401, 2)
        phi = contact_bias(
            had, error, torch.full((401, 1), goal, dtype=torch.float64), config.bias_one_contact, config.bias_floor, 2
        )[:, 0]
        axes.plot(force / goal, phi, color=colour, lw=2, label=name)
    axes.set_xlabel("force / goal force")
    axes.set_ylabel("φ of this finger")
    axes.set_ylim(0, 1.05)
    axes.set_xlim(0, 2)
    axes.legend(frameon=False, fontsize=9, loc="center right")
    axes.spines[["top", "right"]].set_visible(False)
    figure.suptitle("Inductive bias φ by contact state (paper: eq. 7)", fontsize=11)
    return figure, ""


def scene() -> Drawn:
    """Fig. 1, simulation environment: open and grasping."""
    for backend in filter(None, (os.environ.get("MUJOCO_GL"), "egl", "osmesa")):
        # In a process of its own: where there is no OpenGL, some drivers end it.
        environment = {**os.environ, "MUJOCO_GL": backend}
        done = subprocess.run([sys.executable, __file__, "--render"], env=environment, capture_output=True, check=False)
        if done.returncode == 0 and len(done.stdout) == np.prod(PICTURES):
            break
    else:
        print("      left out: no OpenGL without a display; install libegl1 or libosmesa6 (Debian's names)")
        return None, ""
    pictures = np.frombuffer(done.stdout, np.uint8).reshape(PICTURES)
    figure = Figure(figsize=(9, 3.7), layout="constrained")
    for axes, picture, name in zip(figure.subplots(1, 2), pictures, ("fully open", "grasping"), strict=True):
        axes.imshow(picture)
        axes.set_title(name, fontsize=10)
        axes.set_axis_off()
    figure.suptitle("The simulated grasp (paper: Fig. 1, simulation environment)", fontsize=11)
    return figure, ""


def render() -> None:
    """Writes two pictures of the scene to the standard output, as bytes."""
    import mujoco

    from forcegrasp.physics import GraspParameters, GraspSimulator

    simulator = GraspSimulator(1, threads=1)
    simulator.reset(GraspParameters.from_array(np.array([[0.5, -9.0, 0.025, 0.006, 0.5]])))
    renderer = mujoco.Renderer(simulator.scene(0)[0], *PICTURES[1:3])
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance, camera.azimuth, camera.elevation = (0, 0, 0.045), 0.27, 190, -24
    for steps in (5, 60):
        for _ in range(steps):
            simulator.step(np.full((1, 2), 0.0 if steps == 5 else -0.003))
        renderer.update_scene(simulator.scene(0)[1], camera=camera)
        sys.stdout.buffer.write(renderer.render().tobytes())


FIGURES: dict[str, Callable[[], Drawn]] = {
    f.__name__: f for f in (scene, schematic, act_var, solimp_var, fscale_var, stiffness, curriculum, reward, bias)
}


def table(head: str, rows: list[str]) -> str:
    """A Markdown table."""
    return "\n".join([f"| {head} |", "|" + "---|" * (head.count("|") + 1), *(f"| {row} |" for row in rows)]) + "\n"


def into_page(page: Path, name: str, text: str) -> None:
    """Puts a table between the page's marks of that name; a page without them stays as it is."""
    old = page.read_text(encoding="utf-8")
    mark = re.compile(rf"(<!-- measured: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
    page.write_text(mark.sub(lambda m: f"{m[1]}\n{text}\n{m[2]}", old), encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=FIGURES, metavar="NAME", help=f"some of {', '.join(FIGURES)}")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "figures")
    parser.add_argument("--page", type=Path, default=ROOT / "docs" / "calibration.md", help="where tables are kept")
    parser.add_argument("--render", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.render:
        return render()
    options.out.mkdir(parents=True, exist_ok=True)
    names = options.only or list(FIGURES)
    for count, name in enumerate(names, 1):
        began = time.monotonic()
        print(f"[{count}/{len(names)}] {(FIGURES[name].__doc__ or name).splitlines()[0]}", flush=True)
        figure, text = FIGURES[name]()
        if figure is not None:
            path = options.out / f"paper_{name}.png"
            figure.savefig(path, dpi=130, metadata={"Software": ""})
            print(f"      {path} ({time.monotonic() - began:.1f} s)")
        if text:
            print("\n" + text)
            if options.page.is_file():
                into_page(options.page, name, text)
    return None


if __name__ == "__main__":
    main()
