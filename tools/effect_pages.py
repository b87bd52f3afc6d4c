"""Makes docs/effects/: a page and a picture of every effect's symptom, and an index, out of what the classes say.

python tools/effect_pages.py [NAME ...] [--out docs/effects]

A picture compares a grasp of the base model with the same grasp with the effect at its typical size. The grasps are
chosen such that the effect shows.
"""

from __future__ import annotations

import argparse
import inspect
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from forcegrasp.effects import STAGES, Effect, catalogue, get_effect
from forcegrasp.effects.for_gripper import effect_of, why_left_out
from forcegrasp.physics.gripper import Gripper
from forcegrasp.physics.gripper_file import load_gripper
from forcegrasp.physics.plant import Plant, write_base

PERIOD_S, JUMP = 0.04, 9.0
NOISE_M, NOISE_N = 27e-6, 0.013
FORCE_SCALE, RADIUS_M = 2.0, 0.025

#: Effects of servos alone are shown on the first of these that they can show on, at steps of its command, rad.
_SERVOS, _SERVO_STEPS = ("so101_jaw", "xl330_pendulum"), (0.0, 0.3, 0.0, -0.2, 0.1)


@dataclass(frozen=True)
class Show:
    """A grasp on which an effect shows. A move is (target in mm, speed in m/s, pause in s)."""

    what: str
    moves: tuple[tuple[float, float, float], ...]
    offset_m: float = 0.0
    start_m: float = 0.0275


# Pads meet a centred object at 25 mm, and press noticeably from 24.5 mm on.
_STEPS = Show(
    "fast steps in free air and into the object, and a release",
    ((26, JUMP, 0.36), (27.2, JUMP, 0.36), (22, JUMP, 0.52), (23.6, JUMP, 0.4), (27.5, JUMP, 0.4)),
)
_REVERSALS = Show(
    "reversals with pauses in free air, a squeeze, a partial release, a full one",
    ((26.2, 0.008, 0.2), (27.2, 0.008, 0.2), (26.6, 0.008, 0.2),
     (21.8, 0.015, 0.24), (23, 0.006, 0.2), (22.2, 0.006, 0.2), (26.5, 0.015, 0.3)),
)  # fmt: skip
_OFF_CENTRE = Show(
    "a slow squeeze of an object that stands 2 mm towards the right finger, and a slow release",
    ((25.8, 0.015, 0.4), (22.5, 0.003, 0.3), (27.2, 0.006, 0.2)),
    offset_m=0.002,
)
_STRONGER = Show(
    "squeezes of growing strength, as fast steps",
    ((23.8, JUMP, 0.5), (22.5, JUMP, 0.5), (21, JUMP, 0.6), (19, JUMP, 0.6), (26, JUMP, 0.4)),
)
_STEPS_OF_SEVERAL_SIZES = Show(
    "steps of 0.6, 1.8 and 4.5 mm, and a slow ramp",
    ((26.9, JUMP, 0.4), (25.1, JUMP, 0.5), (26.5, 0.006, 0.2), (22, JUMP, 0.7), (23.2, 0.006, 0.2)),
)
_SQUEEZES = Show(
    "squeezes of growing strength, and a slow release",
    ((23.8, 0.02, 0.4), (22, 0.02, 0.4), (20, 0.02, 0.4), (18, 0.02, 0.4), (26.5, 0.01, 0.2)),
)
_LIGHT_TOUCHES = Show(
    "a light touch, a squeeze, partial releases",
    ((24.2, 0.01, 0.3), (23.7, 0.01, 0.3), (22, 0.006, 0.2),
     (24, 0.006, 0.3), (22.8, 0.006, 0.2), (26.5, 0.01, 0.2)),
)  # fmt: skip
_PLANS = {
    "command_deadband": Show(
        "steps of 0.2 mm and of 0.4 mm in free air, a squeeze, a release in increments of 0.1 mm",
        ((27.3, JUMP, 0.28), (27.1, JUMP, 0.28), (26.9, JUMP, 0.28), (26.7, JUMP, 0.28),
         (27.1, JUMP, 0.28), (27.5, JUMP, 0.28), (22.5, 0.015, 0.3), (23.5, 0.0025, 0.3)),
    ),
    "rate_limit": _STEPS_OF_SEVERAL_SIZES,
    "rate_limited_lag": _STEPS_OF_SEVERAL_SIZES,
    "stiction": Show(
        "slow ramps and pauses in free air, and a slow squeeze",
        ((26, 0.0012, 0.2), (27, 0.0012, 0.2), (26.6, 0.0012, 0.2), (23, 0.004, 0.3)),
    ),
    "load_friction": Show(
        "holds at growing loads, each approached while closing and while opening",
        ((24, 0.02, 0.24), (22.6, 0.02, 0.3), (23.3, 0.01, 0.3), (20, 0.02, 0.3), (21.6, 0.01, 0.3), (27, 0.02, 0.2)),
    ),
    "back_emf": Show(
        "steps of growing size in free air and into the object, and a release",
        ((26.9, JUMP, 0.4), (25.1, JUMP, 0.5), (27.4, JUMP, 0.5), (21, JUMP, 0.7), (27, JUMP, 0.6)),
    ),
    "position_deadband": Show(
        "steps of 0.4 and 1.5 mm in free air, a squeeze, a release in small increments",
        ((27.1, JUMP, 0.3), (26.7, JUMP, 0.3), (27.1, JUMP, 0.3), (25.6, JUMP, 0.4), (27.1, JUMP, 0.4),
         (22.5, 0.015, 0.3), (23.5, 0.0025, 0.3)),
    ),
    "presliding": Show(
        "reversals of 0.1 to 0.8 mm in free air, and a squeeze",
        ((26.2, 0.008, 0.2), (26.3, 0.008, 0.2), (26.1, 0.008, 0.2), (26.5, 0.008, 0.2), (25.9, 0.008, 0.2),
         (26.7, 0.008, 0.2), (22.5, 0.015, 0.3), (22.8, 0.006, 0.3)),
    ),
    "smooth_friction": Show(
        "fast and slow moves in free air with long pauses after them, and a squeeze",
        ((26.2, 0.02, 1.2), (27, 0.004, 1.2), (22.5, 0.015, 0.8)),
    ),
    "smooth_load_friction": Show(
        "squeezes and a partial release, each with a long hold",
        ((26, 0.02, 0.1), (22.6, 0.02, 1.2), (20, 0.02, 1.2), (21.6, 0.01, 1.2), (27, 0.02, 0.2)),
    ),
    "smooth_stiction": Show(
        "slow and fast moves in free air with long pauses after them, and a squeeze",
        ((26.2, 0.002, 0.8), (27, 0.02, 0.8), (26.4, 0.004, 0.8), (22.5, 0.015, 0.8)),
    ),
    "direction_friction": Show(
        "fast ramps, opening and closing, in free air; a squeeze and a release",
        ((25.6, 0.02, 0.4), (27.4, 0.02, 0.4), (25.6, 0.02, 0.4), (22, 0.02, 0.3), (27, 0.02, 0.4)),
    ),
    "viscous_friction": Show(
        "fast and slow ramps in free air; a squeeze and a release",
        ((25.6, 0.02, 0.4), (27.4, 0.02, 0.4), (26.4, 0.004, 0.4), (22, 0.02, 0.3), (27, 0.02, 0.4)),
    ),
    "readout_skew": _STEPS,
    "elastic_transmission": Show("steps of a servo's jaw", ()),
    "elastic_joint": Show("steps of a servo with a pendulum", ()),
    "loose_joint": Show("steps of a servo with a pendulum", ()),
    "velocity_lag": Show("steps of a servo's jaw", ()),
    "force_limit": _STRONGER,
    "smooth_force_limit": _STRONGER,
    "force_saturation": Show(
        "squeezes of growing strength",
        ((23.8, 0.02, 0.4), (22, 0.02, 0.4), (20, 0.02, 0.4), (18, 0.02, 0.4), (26.5, 0.03, 0.2)),
    ),
    "finger_compliance": _SQUEEZES,
    "friction_asymmetry": _STEPS,
    "compliance_asymmetry": _SQUEEZES,
    "motor_asymmetry": _STEPS,
    "return_spring": _STEPS_OF_SEVERAL_SIZES,
    "encoder_scale": _STEPS,
    "finger_creep": Show(
        "a fast squeeze, a long hold, a partial release, another hold",
        ((26, 0.02, 0.1), (19, JUMP, 2.0), (21.5, JUMP, 1.6), (27, 0.02, 0.2)),
    ),
    "stiffening_contact": Show(
        "a slow squeeze to a high force, and a slow release",
        ((25, 0.02, 0.2), (19, 0.003, 0.3), (26, 0.006, 0.2)),
    ),
    "contact_damping": Show("two fast touches", ((25, 0.02, 0.2), (21, JUMP, 0.5), (26, 0.02, 0.2), (22, JUMP, 0.5))),
    "contact_onset": Show("two fast touches", ((25, 0.02, 0.2), (21, JUMP, 0.5), (26, 0.02, 0.2), (22, JUMP, 0.5))),
    "hunt_crossley_contact": Show(
        "a slow squeeze to a high force, a release, and a fast touch",
        ((25, 0.02, 0.2), (19, 0.003, 0.3), (26, 0.02, 0.2), (20, JUMP, 0.4)),
    ),
    "viscoelastic_contact": Show(
        "a fast squeeze, a long hold, a partial release, another hold",
        ((26, 0.02, 0.1), (19, JUMP, 2.0), (21.5, JUMP, 1.6), (27, 0.02, 0.2)),
    ),
    "adhesion": Show(
        "two slow full releases",
        ((22.6, 0.02, 0.3), (26, 0.006, 0.2), (23, 0.02, 0.3), (25.6, 0.003, 0.2)),
    ),
    "two_mass_backlash": _STEPS,
    "object_friction": _OFF_CENTRE,
    "smooth_object_friction": _OFF_CENTRE,
    "contact_friction": _OFF_CENTRE,
    "table_friction": _OFF_CENTRE,
    "object_mass": _OFF_CENTRE,
    "object_pull": _SQUEEZES,
    "force_crosstalk": _OFF_CENTRE,
    "swapped_forces": _OFF_CENTRE,
    "object_size": Show("a squeeze, a hold, a release", ((25.8, 0.02, 0.2), (22, 0.01, 0.6), (26.5, 0.01, 0.2))),
    "force_hysteresis": Show(
        "the same squeeze and release at two speeds",
        ((25, 0.03, 0.1), (21, 0.012, 0.08), (25.2, 0.012, 0.2), (21, 0.003, 0.08), (25.2, 0.003, 0.2)),
    ),
    "rounded_force_hysteresis": Show(
        "a squeeze with partial releases of several sizes",
        ((25, 0.03, 0.1), (21, 0.012, 0.1), (21.8, 0.012, 0.1), (21, 0.012, 0.1), (23.4, 0.012, 0.1),
         (21, 0.012, 0.1), (26.5, 0.012, 0.2)),
    ),
    "force_gain_asymmetry": Show(
        "a squeeze, a hold, a release", ((25, 0.02, 0.1), (21, 0.01, 1.0), (26.5, 0.01, 0.2))
    ),
    "force_deadzone": _LIGHT_TOUCHES,
    "deadzone_asymmetry": _LIGHT_TOUCHES,
    "force_drift": Show(
        "free air, a squeeze with a long hold, free air again",
        ((26, 0.02, 0.8), (21.5, 0.01, 3.0), (27, 0.02, 1.6)),
    ),
    "force_bias": Show("free air, a squeeze, free air", ((26, 0.02, 0.4), (21.5, 0.01, 0.6), (27, 0.02, 0.6))),
    "quantisation": Show("a slow light squeeze and release", ((23.2, 0.0015, 0.2), (25, 0.002, 0.2)), start_m=0.025),
    "command_delay": _STEPS,
    "delay_asymmetry": _STEPS,
    "actuator_lag": _STEPS,
    "second_order_lag": _STEPS,
    "force_lag": _STEPS,
    "force_delay": _STEPS,
}  # fmt: skip


def commands(show: Show) -> np.ndarray:
    """Commanded positions of both fingers alike, metres, ``(samples,)``."""
    path = [show.start_m] * 4
    for target_mm, speed, pause in show.moves:
        target = target_mm / 1000
        steps = max(1, round(abs(target - path[-1]) / (speed * PERIOD_S)))
        path += [*np.linspace(path[-1], target, steps + 1)[1:], *[target] * round(pause / PERIOD_S)]
    return np.array(path)


def simulate(effect: type[Effect], show: Show) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, positions and forces that are read, each ``(samples, 2, 2)``: base and effect, left and right finger."""
    plant = Plant(load_gripper("tiago"), 2, threads=1)
    plant.attach([(effect(effect.typical_values()[None], plant.dt), np.array([1]))])
    ids = np.arange(2)
    write_base(plant, ids, {"force_scale": np.full(2, FORCE_SCALE), "radius_m": np.full(2, RADIUS_M)})
    plant.reset(ids, np.full(2, show.offset_m), np.full((2, 2), show.start_m))
    position, force = [], []
    for command in commands(show):
        position.append(plant.measured_position)
        force.append(plant.measured_force)
        plant.advance(np.full((2, 2), command), round(PERIOD_S / plant.dt))
    return PERIOD_S * np.arange(len(position)), np.array(position), np.array(force)


def draw(effect: type[Effect], path: Path) -> None:
    """Draws base against effect: positions, forces, and their difference in units of sensor noise."""
    if effect.servo_only:
        draw_servo(effect, path)
        return
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from PIL import Image

    show = _PLANS.get(effect.name, _REVERSALS)
    time, position, force = simulate(effect, show)
    command = commands(show)
    figure, axes = plt.subplots(
        3, 2, sharex=True, sharey="row", figsize=(9, 6.2), height_ratios=(3, 3, 1.6), constrained_layout=True
    )
    base, ours = {"color": "0.6", "lw": 2.4}, {"color": "tab:red", "lw": 1.3}
    for side, name in enumerate(("left", "right")):
        top, middle, bottom = axes[:, side]
        top.set_title(f"{name} finger")
        top.step(time, 1e3 * command, "k:", lw=1, where="post", label="command")
        top.plot(time, 1e3 * position[:, 0, side], **base, label="base model")
        top.plot(time, 1e3 * position[:, 1, side], **ours, label=f"with {effect.name}")
        middle.plot(time, force[:, 0, side], **base)
        middle.plot(time, force[:, 1, side], **ours)
        bottom.plot(
            time, (position[:, 1, side] - position[:, 0, side]) / NOISE_M, "tab:green", label="difference in position"
        )
        bottom.plot(time, (force[:, 1, side] - force[:, 0, side]) / NOISE_N, "tab:blue", label="in force")
        bottom.set_xlabel("time [s]")
        for ax in (top, middle, bottom):
            ax.grid(alpha=0.3)
    for ax, text in zip(axes[:, 0], ("position [mm]", "force [N]", "difference\n[sensor noise]"), strict=True):
        ax.set_ylabel(text)
    handles = [*axes[0, 0].get_lines(), *axes[2, 0].get_lines()]
    figure.legend(handles=handles, loc="outside upper center", ncol=len(handles), frameon=False)
    figure.savefig(path, dpi=85)
    plt.close(figure)
    Image.open(path).convert("RGB").quantize(96).save(path, optimize=True)


def draw_servo(effect: type[Effect], path: Path) -> None:
    """Draws base against effect on a servo: position, and the difference of the two."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from PIL import Image

    plant = Plant(servo_for(effect), 2, threads=1)
    effect = effect_of(effect.name, plant.gripper)
    plant.attach([(effect(effect.typical_values()[None], plant.dt), np.array([1]))])
    plant.reset(np.arange(2), np.zeros(2))
    command, read = np.repeat(_SERVO_STEPS, 250), []
    for target in command:
        plant.advance(np.full((2, 1), target))
        read.append(plant.measured_position[:, 0])
    time, position = plant.dt * np.arange(1, len(read) + 1), np.array(read)
    figure, (top, bottom) = plt.subplots(
        2, 1, sharex=True, figsize=(9, 4.6), height_ratios=(3, 1.6), constrained_layout=True
    )
    top.plot(time, command, "k:", lw=1, label="command")
    top.plot(time, position[:, 0], color="0.6", lw=2.4, label="base model")
    top.plot(time, position[:, 1], color="tab:red", lw=1.3, label=f"with {effect.name}")
    bottom.plot(time, position[:, 1] - position[:, 0], "tab:green", label="difference")
    for ax, text in ((top, "position [rad]"), (bottom, "difference [rad]")):
        ax.set_ylabel(text)
        ax.grid(alpha=0.3)
    bottom.set_xlabel("time [s]")
    handles = [*top.get_lines(), *bottom.get_lines()]
    figure.legend(handles=handles, loc="outside upper center", ncol=len(handles), frameon=False)
    figure.savefig(path, dpi=85)
    plt.close(figure)
    Image.open(path).convert("RGB").quantize(96).save(path, optimize=True)


def servo_for(effect: type[Effect]) -> Gripper:
    """The mechanism that an effect of servos alone is shown on."""
    return next(gripper for gripper in map(load_gripper, _SERVOS) if not why_left_out(effect, gripper))


def size(effect: type[Effect]) -> str:
    """The typical size in words, as on what shows it."""
    if effect.servo_only:
        effect = effect_of(effect.name, servo_for(effect))
    return ", ".join(f"{p.name} = {p.typical:g}{'' if p.unit == '1' else ' ' + p.unit}" for p in effect.parameters)


def page(effect: type[Effect]) -> str:
    """An effect's page."""
    first, _, rest = inspect.cleandoc(effect.__doc__ or "").replace("``", "`").partition("\n\n")
    show = _PLANS.get(effect.name, _REVERSALS)
    variant = f", variant `{effect.variants[0]}`" if effect.variants[0] else ""
    lines = [f"# {effect.name}", "", first, ""]
    lines += [rest, ""] if rest else []
    lines += [
        f"**You see:** {effect.symptom}.",
        "",
        f"![{effect.name}]({effect.name}.png)",
        "",
        f"*{show.what[0].upper()}{show.what[1:]}; {size(effect)}{variant}.*",
        "",
        f"    {effect.formula}",
        "",
        f"Family: {effect.family}. Stage: {effect.stage}. Source: {effect.source}.",
        "",
        "| parameter | meaning | unit | bounds | typical | not there at |",
        "|---|---|---|---|---|---|",
    ]
    for p in effect.parameters:
        null = "any" if p.null == p.typical else f"{p.null:g}"
        lines.append(f"| `{p.name}` | {p.doc} | {p.unit} | {p.low:g} to {p.high:g} | {p.typical:g} | {null} |")
    for nested in effect.contains:
        at = ", ".join(f"`{name}` = {value:g}" for name, value in nested.at.items())
        lines += ["", f"At {at} it is [{nested.effect}]({nested.effect}.md)."]
    if effect.look_alikes:
        lines += ["", "## What looks like it", ""]
        lines += [f"- [{name}]({name}.md): {get_effect(name).symptom}" for name in effect.look_alikes]
    if effect.separates:
        lines += ["", f"**What separates them:** {effect.separates}."]
    return "\n".join(lines) + "\n"


def index() -> str:
    """The index of all pages."""
    lines = [
        "# Effects",
        "",
        "What a simulator of a gripper may lack, in the order in which it acts. Each page has a picture of the symptom:"
        " the same grasp without and with the effect. `forcegrasp effects NAME` says the same in the terminal. Sizes"
        " are those of the paper's gripper: with `gripper=` they are in proportion to that one's, in radians and N·m of"
        " a motor that turns.",
        "",
        "These pages are made by `python tools/effect_pages.py`.",
    ]
    for stage in STAGES:
        lines += ["", f"## {stage.capitalize()}", "", "| effect | family | you see | looks like |", "|---|---|---|---|"]
        for effect in catalogue().values():
            if effect.stage == stage:
                alike = ", ".join(f"[{name}]({name}.md)" for name in effect.look_alikes)
                cells = (f"[{effect.name}]({effect.name}.md)", effect.family, effect.symptom, alike)
                lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="effects; all of them by default")
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "docs/effects")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    for effect in map(get_effect, options.names) if options.names else catalogue().values():
        (options.out / f"{effect.name}.md").write_text(page(effect), encoding="utf-8")
        draw(effect, options.out / f"{effect.name}.png")
    (options.out / "README.md").write_text(index(), encoding="utf-8")


if __name__ == "__main__":
    main()
