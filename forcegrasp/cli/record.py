"""``forcegrasp record``: a measurement set from the simulator."""

from __future__ import annotations

from forcegrasp.cli.results import default_out
from forcegrasp.cli.verb import Verb
from forcegrasp.config.verbs import RecordConfig
from forcegrasp.errors import ConfigError

NOTES = """
  "effects=[backlash,'force_lag time_constant_s=0.1']"
                   effects of a typical size, or of the size given; forcegrasp effects lists them. The set does not tell
                   them: what forcegrasp diagnose says can be held against them
  next=runs/why/diagnosis.json
                   the grasp that a diagnosis proposes, in a set of its own, with the other options (effects, seed,
                   objects, gripper …) as the set that was diagnosed was recorded with
"""


def run(config: RecordConfig) -> None:
    """Runs the verb."""

    from pathlib import Path

    from forcegrasp.measure import write_set
    from forcegrasp.models.variation import read_model_of, with_noise_of
    from forcegrasp.physics.completion import complete
    from forcegrasp.physics.gripper_file import load_gripper
    from forcegrasp.replay.next_grasp import read_next_grasp
    from forcegrasp.replay.record import parse_effect, record

    out = default_out("record", config.out)
    gripper = load_gripper(config.gripper)
    proposed = read_next_grasp(Path(config.next), gripper) if config.next else None
    model = read_model_of(gripper, config.model) if config.model else None
    config = complete(config, with_noise_of(gripper, model))
    effects, known = [parse_effect(text, gripper) for text in config.effects], {}
    if model:
        known = {name: fitted.value for name, fitted in model.base.items()}
        effects = [*(e.setting for e in model.effects), *effects]
    names = [one.effect.name for one in effects]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"effects: {name} is there twice")
    what = f"{proposed.grasp} on {proposed.object}" if proposed else f"{config.grasps} grasps"
    print(f"recording {what}" + (f" with {', '.join(names)}" if names else ""))
    recorded = record(
        gripper,
        config.plan,
        grasps=config.grasps,
        objects=min(config.objects, config.grasps),
        effects=effects,
        known=known,
        off_nominal=config.off_nominal,
        position_std_m=config.position_std_m,
        force_std_n=config.force_std_n,
        seed=config.seed,
        next_grasp=proposed,
    )
    write_set(recorded.measured, out, config.samples)
    if proposed:
        print(f"wrote {out}. Diagnose SET again with it: forcegrasp diagnose SET {out}")
    else:
        print(f"wrote {out}. See where the model fails: forcegrasp compare data={out}")


VERB = Verb(
    "record",
    "make a measurement set from the simulator, with effects hidden in it if you like",
    run=run,
    notes=NOTES,
    schema=RecordConfig,
)
