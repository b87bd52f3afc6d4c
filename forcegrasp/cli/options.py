"""From ``key=value`` arguments to a checked configuration, by way of Hydra; and the help text of a verb."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Iterator, Sequence
from importlib.resources import files
from typing import Any

from forcegrasp.cli.spelling import spell_out
from forcegrasp.config import (
    AddConfig,
    CompareConfig,
    CurvesConfig,
    DiagnoseConfig,
    EvaluateConfig,
    ExportConfig,
    FitConfig,
    RecordConfig,
    RenderConfig,
    TrainConfig,
    is_left_out,
    validate,
)
from forcegrasp.errors import ConfigError, closest

#: The key with which a Hydra config would name a Python object; put together, as it may stand nowhere in this project.
OBJECT_KEY = "_".join(("", "target", ""))
SCHEMAS: dict[str, type] = {
    "record": RecordConfig,
    "compare": CompareConfig,
    "fit": FitConfig,
    "diagnose": DiagnoseConfig,
    "add": AddConfig,
    "train": TrainConfig,
    "evaluate": EvaluateConfig,
    "export": ExportConfig,
    "curves": CurvesConfig,
    "render": RenderConfig,
}
#: What a training takes of Hydra's own options. Others name search paths, callbacks and classes, that is, code.
LAUNCHERS = ["basic", "joblib", "submitit_local", "submitit_slurm"]
LAUNCHER_OPTIONS = (
    *("n_jobs", "partition", "account", "qos", "constraint", "exclude", "array_parallelism", "timeout_min"),
    *("max_num_timeout", "cpus_per_task", "mem_gb", "gpus_per_node", "gres"),
)
HYDRA_OPTIONS = ("hydra.run.dir", "hydra.sweep.dir", *(f"hydra.launcher.{name}" for name in LAUNCHER_OPTIONS))

#: Options of sections that a short help shows; those without a section are always there.
COMMON = (
    *("physics.threads", "grasp.kappa", "grasp.steps", "sensors.force_std_n"),
    *("ppo.total_frames", "ppo.grasps", "ppo.learning_rate", "log.video_every"),
)
HELP_WIDTH = 100


def compose(verb: str, overrides: list[str]) -> Any:
    """Returns the verb's configuration with the overrides applied, checked.

    Raises:
      ConfigError: if an option is unknown, of the wrong type, or out of its range.
    """
    return compose_run(verb, overrides)[0]


def compose_run(verb: str, overrides: list[str], own: Sequence[str] = ()) -> tuple[Any, str]:
    """Like :func:`compose`, and also returns where Hydra would put the run (``hydra.run.dir``).

    ``own`` are overrides of the program's, not the user's: they come first and are not checked.
    """
    config, hydra = _compose(verb, overrides, own)
    return config, _folder("hydra.run.dir", hydra["run"]["dir"])


def compose_sweep(overrides: list[str]) -> tuple[dict[str, str], str]:
    """Returns what the preset of ``sweep`` sweeps (option → its values, as text), and the sweep's folder.

    Args:
      overrides: the command line's, less those that have several values.

    Raises:
      ConfigError: as :func:`compose`.
    """
    _, hydra = _compose("train", overrides)
    swept = {key: str(values) for key, values in (hydra["sweeper"].get("params") or {}).items()}
    return swept, _folder("hydra.sweep.dir", hydra["sweep"]["dir"])


def spell_sweep(verb: str, overrides: list[str]) -> list[str]:
    """Returns a sweep's overrides as Hydra wants them: each value of a list in brackets."""
    return spell_out(verb, overrides, _defaults(verb), parse_override, sweep=True)


def _defaults(verb: str) -> dict[str, Any]:
    return {name: value for name, _, value in leaves(SCHEMAS[verb])}


def _compose(verb: str, overrides: list[str], own: Sequence[str] = ()) -> tuple[Any, dict[str, Any]]:
    """Returns the verb's configuration, checked, and Hydra's own: run, sweep and sweeper."""
    from hydra import compose as hydra_compose
    from hydra import initialize_config_module
    from hydra.core.global_hydra import GlobalHydra
    from hydra.core.hydra_config import HydraConfig
    from hydra.errors import HydraException
    from omegaconf import OmegaConf, open_dict
    from omegaconf.errors import OmegaConfBaseException

    register_schemas()
    overrides = spell_out(verb, overrides, _defaults(verb), parse_override)
    choices, known = groups(verb), list(_defaults(verb))
    if verb == "train":
        choices, known = choices | {"hydra/launcher": LAUNCHERS}, [*known, *HYDRA_OPTIONS]
    for override in overrides:
        _check_override(verb, override, choices, known)
    GlobalHydra.instance().clear()
    try:
        with initialize_config_module("forcegrasp.conf", version_base="1.3"):
            full = [*own, *(_full_name(verb, override) for override in overrides)]
            composed = hydra_compose(verb, overrides=full, return_hydra_config=True)
        HydraConfig.instance().set_config(composed)
        hydra = {"run": {"dir": str(composed.hydra.run.dir)}, "sweeper": composed.hydra.sweeper}
        hydra["sweep"] = {"dir": str(composed.hydra.sweep.dir)}
        with open_dict(composed):
            del composed.hydra
        config = OmegaConf.to_object(composed)
    except (HydraException, OmegaConfBaseException) as error:
        raise ConfigError(_one_line(error)) from error
    validate(config)
    return config, hydra


def _folder(option: str, value: str) -> str:
    if not value.strip():
        raise ConfigError(f"{option} is empty: name a folder, or leave it out")
    return value


def register_schemas() -> None:
    """Makes the config dataclasses known to Hydra, under the names that conf/ uses."""
    from hydra.core.config_store import ConfigStore

    for verb, schema in SCHEMAS.items():
        ConfigStore.instance().store(f"{verb}_schema", node=schema)


def groups(verb: str) -> dict[str, list[str]]:
    """Config groups of a verb and their choices, from conf/; a group of one verb alone lies in conf/VERB."""
    conf = files("forcegrasp.conf")
    text = (conf / f"{verb}.yaml").read_text("utf-8")
    own = conf / verb
    folders = {f.name: f for f in conf.iterdir() if f.is_dir() and f"- {f.name}:" in text}
    folders |= {f.name: f for f in own.iterdir()} if own.is_dir() else {}
    return {
        name: sorted(f.name.removesuffix(".yaml") for f in folder.iterdir() if f.name.endswith(".yaml"))
        for name, folder in sorted(folders.items())
    }


def _full_name(verb: str, override: str) -> str:
    """The override as Hydra wants it: groups of one verb are typed without its name."""
    group = override.partition("=")[0]
    return f"{verb}/{override}" if (files("forcegrasp.conf") / verb / group).is_dir() and group else override


def leaves(schema: Any, prefix: str = "") -> Iterator[tuple[str, dataclasses.Field, Any]]:
    """Every option of a schema: dotted name, field, default."""
    instance = schema() if isinstance(schema, type) else schema
    for entry in dataclasses.fields(instance):
        value = getattr(instance, entry.name)
        if dataclasses.is_dataclass(value):
            yield from leaves(value, f"{prefix}{entry.name}.")
        else:
            yield f"{prefix}{entry.name}", entry, value


def parse_override(override: str) -> Any:
    """Returns Hydra's reading of one ``key=value``.

    Raises:
      ConfigError: if it can't be read.
    """
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.core.override_parser.types import Glob
    from hydra.errors import HydraException

    try:
        parsed = OverridesParser.create().parse_override(override)
    except HydraException as error:
        raise ConfigError(f"{override!r}: can't be read ({str(error).splitlines()[0]})") from error
    if isinstance(parsed.value(), Glob):
        raise ConfigError(f"{override!r}: glob() is not known here; write the values one by one, as in a,b,c")
    return parsed


def _check_override(verb: str, override: str, choices: dict[str, list[str]], known: list[str]) -> None:
    """Refuses one override that is malformed, unknown, or has several values."""
    key, equals, value = override.partition("=")
    if not equals:
        raise ConfigError(f"{override!r}: options are given as key=value, see forcegrasp {verb} --help")
    if OBJECT_KEY in key or ("{" in value and OBJECT_KEY in value):
        raise ConfigError(f"{override!r}: no option may name a Python object")
    if key in choices:
        for choice in value.split(","):
            if choice.strip() not in choices[key]:
                raise ConfigError(f"no {key} named {choice.strip()!r}{closest(choice.strip(), choices[key])}")
    elif key not in known:
        own = [name for name in [*known, *choices] if name.startswith("hydra") == key.startswith("hydra")]
        raise ConfigError(f"no option {key!r}{closest(key, own or known)}")
    if parse_override(override).is_sweep_override():
        sweep = "; to run one after another, add -m" if verb == "train" else ""
        raise ConfigError(f"{override!r}: several values; a list is written [a,b]{sweep}")


def _one_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    key = next((line.removeprefix("full_key: ") for line in lines if line.startswith("full_key: ")), "")
    cause = str(error.__cause__ or "").strip().splitlines()
    text = lines[0] if lines else type(error).__name__
    if text.startswith("Error merging override") and cause:
        text = f"{text.removeprefix('Error merging override ')}: {cause[0]}"
    return f"{key}: {text}" if key and key not in text else text


def help_text(verb: str, purpose: str, notes: str = "", plain: str = "", everything: bool = True) -> str:
    """The verb's help: groups, then options.

    Args:
      verb: its name.
      purpose, notes: what it is for, and what is no option of it.
      plain: what it takes without ``key=``.
      everything: every option with default, unit, meaning and source; else a line for each that is common.
    """
    usage = f"usage: forcegrasp {verb} {plain and f'[{plain}] '}[key=value ...]"
    lines = [f"forcegrasp {verb}: {purpose}", "", usage, ""]
    if notes:
        lines += [notes.strip("\n"), ""]
    presets = [f"  {name}={'|'.join(choices)}" for name, choices in groups(verb).items()]
    if presets:
        lines += ["presets (a preset sets several options; options given beside it win)", *presets]
    else:
        lines.pop()
    return "\n".join([*lines, *(_every_option(verb) if everything else _common_options(verb))]) + "\n"


def _every_option(verb: str) -> Iterator[str]:
    section = None
    for name, entry, default in leaves(SCHEMAS[verb]):
        head = name.rpartition(".")[0]
        if head != section:
            section = head
            yield from ("", head or "general")
        meta = entry.metadata
        detail = (
            meta["doc"]
            + (f" [{meta['unit']}]" if meta["unit"] else "")
            + (f" ({meta['source']})" if meta["source"] else "")
        )
        if not all(choice in detail for choice in meta["choices"]):
            detail += f": {' or '.join(meta['choices'])}"
        yield f"  {_with_default(name, entry, default)}\n{'':<6}{detail}"


def _common_options(verb: str) -> Iterator[str]:
    options = list(leaves(SCHEMAS[verb]))
    shown = [option for option in options if "." not in option[0] or option[0] in COMMON]
    yield from ("", "common options")
    for name, entry, default in shown:
        unit = f" [{entry.metadata['unit']}]" if entry.metadata["unit"] else ""
        head, text = _with_default(name, entry, default), entry.metadata["doc"] + unit
        first, *more = textwrap.wrap(f"  {head:<27} {text}", HELP_WIDTH, subsequent_indent=" " * 30)
        yield "\n".join([first, *more])
    sections = sorted({name.partition(".")[0] for name, _, _ in options if "." in name})
    yield f"\n{len(options) - len(shown)} more of {', '.join(sections)}:\n  forcegrasp {verb} --help --all"


def _with_default(name: str, entry: dataclasses.Field, default: Any) -> str:
    if entry.metadata["of_gripper"] and is_left_out(default):
        return f"{name}=(of gripper)"
    return f"{name}={str(default).replace(chr(39), '').replace(' ', '')}"
