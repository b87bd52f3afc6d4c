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
"""


def run(config: RecordConfig) -> None:
    """Runs the verb."""

    from forcegrasp.measure import write_set
    from forcegrasp.models.variation import read_model_of, with_noise_of
    from forcegrasp.physics.completion import complete
    from forcegrasp.physics.gripper_file import load_gripper
    from forcegrasp.replay.record import parse_effect, record

    out = default_out("record", config.out)
    gripper = load_gripper(config.gripper)
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
    print(f"recording {config.grasps} grasps" + (f" with {', '.join(names)}" if names else ""))
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
    )
    write_set(recorded.measured, out, config.samples)
    print(f"wrote {out}. See where the model fails: forcegrasp compare data={out}")


VERB = Verb(
    "record",
    "make a measurement set from the simulator, with effects hidden in it if you like",
    run=run,
    notes=NOTES,
    schema=RecordConfig,
)
