"""From ``key=value`` arguments to a checked configuration, by way of Hydra."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterator
from importlib.resources import files
from typing import Any

from forcegrasp.cli.spelling import spell_out
from forcegrasp.cli.verbs import VERBS
from forcegrasp.config import validate
from forcegrasp.errors import ConfigError, closest

#: The key with which a Hydra config would name a Python object; put together, as it may stand nowhere in this project.
OBJECT_KEY = "_".join(("", "target", ""))
SCHEMAS: dict[str, type] = {verb.name: verb.schema for verb in VERBS.values() if verb.schema}
#: What a training takes of Hydra's own options. Others name search paths, callbacks and classes, that is, code.
LAUNCHERS = ["basic", "joblib", "submitit_local", "submitit_slurm"]
LAUNCHER_OPTIONS = (
    *("n_jobs", "partition", "account", "qos", "constraint", "exclude", "array_parallelism", "timeout_min"),
    *("max_num_timeout", "cpus_per_task", "mem_gb", "gpus_per_node", "gres"),
)
HYDRA_OPTIONS = ("hydra.run.dir", "hydra.sweep.dir", *(f"hydra.launcher.{name}" for name in LAUNCHER_OPTIONS))


def compose(verb: str, overrides: list[str]) -> Any:
    """Returns the verb's configuration with the overrides applied, checked.

    Raises:
      ConfigError: if an option is unknown, of the wrong type, or out of its range.
    """
    return compose_run(verb, overrides)[0]


def compose_run(verb: str, overrides: list[str]) -> tuple[Any, str]:
    """Like :func:`compose`, and also returns where Hydra would put the run (``hydra.run.dir``)."""
    config, hydra = _compose(verb, overrides)
    return config, _folder("hydra.run.dir", hydra["run"]["dir"])


def with_value(config: Any, override: str) -> Any:
    """A composed configuration with another value of an option that is no group's, in a twentieth of Hydra's time.

    Raises:
      ConfigError: as :func:`compose`.
    """
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    parsed, node = parse_override(override), OmegaConf.structured(config)
    try:
        OmegaConf.update(node, parsed.get_key_element(), parsed.value())
    except OmegaConfBaseException as error:
        raise ConfigError(f"{override}: {str(error).splitlines()[0]}") from error
    changed = OmegaConf.to_object(node)
    validate(changed)
    return changed


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
    return spell_out(VERBS[verb], overrides, _defaults(verb), parse_override, sweep=True)


def _defaults(verb: str) -> dict[str, Any]:
    return {name: value for name, _, value in leaves(SCHEMAS[verb])}


def _compose(verb: str, overrides: list[str]) -> tuple[Any, dict[str, Any]]:
    """Returns the verb's configuration, checked, and Hydra's own: run, sweep and sweeper."""
    from hydra import compose as hydra_compose
    from hydra import initialize_config_module
    from hydra.core.global_hydra import GlobalHydra
    from hydra.core.hydra_config import HydraConfig
    from hydra.errors import HydraException
    from omegaconf import OmegaConf, open_dict
    from omegaconf.errors import OmegaConfBaseException

    register_schemas()
    overrides = spell_out(VERBS[verb], overrides, _defaults(verb), parse_override)
    choices, known = groups(verb), list(_defaults(verb))
    if VERBS[verb].multirun:
        choices, known = choices | {"hydra/launcher": LAUNCHERS}, [*known, *HYDRA_OPTIONS]
    for override in overrides:
        _check_override(verb, override, choices, known)
    GlobalHydra.instance().clear()
    try:
        with initialize_config_module("forcegrasp.conf", version_base="1.3"):
            full = [_full_name(verb, override) for override in overrides]
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
    """Makes the config dataclasses known to Hydra: as VERB_schema where conf/VERB.yaml adds presets, else as VERB."""
    from forcegrasp.cli import run_name

    run_name.register()
    for verb, schema in SCHEMAS.items():
        _store(verb, schema)


@functools.cache
def _store(verb: str, schema: type) -> None:
    from hydra.core.config_store import ConfigStore

    ConfigStore.instance().store(f"{verb}_schema" if _own_file(verb) else verb, node=schema)


def _own_file(verb: str) -> str:
    """What conf/VERB.yaml says; empty where a verb has no presets."""
    file = files("forcegrasp.conf") / f"{verb}.yaml"
    return file.read_text("utf-8") if file.is_file() else ""


def groups(verb: str) -> dict[str, list[str]]:
    """Config groups of a verb and their choices, from conf/; a group of one verb alone lies in conf/VERB."""
    conf = files("forcegrasp.conf")
    text, own = _own_file(verb), conf / verb
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
        sweep = "; to run one after another, add -m" if VERBS[verb].multirun else ""
        raise ConfigError(f"{override!r}: several values; a list is written [a,b]{sweep}")


def _one_line(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    key = next((line.removeprefix("full_key: ") for line in lines if line.startswith("full_key: ")), "")
    cause = str(error.__cause__ or "").strip().splitlines()
    text = lines[0] if lines else type(error).__name__
    if text.startswith("Error merging override") and cause:
        text = f"{text.removeprefix('Error merging override ')}: {cause[0]}"
    return f"{key}: {text}" if key and key not in text else text
