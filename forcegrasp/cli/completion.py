"""``forcegrasp completion``: a script with which a shell completes verbs, options, presets, effects and policies.

All that can be completed is written into the script, so that no Python starts when a key is pressed.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files

from forcegrasp.cli.verb import Verb
from forcegrasp.errors import ConfigError, closest

SHELLS = ("bash", "zsh", "fish")
NOTES = """
Once, and again when another version or other effects have been installed:

  bash    forcegrasp completion bash > ~/.local/share/bash-completion/completions/forcegrasp
          (make the folder first; without the package bash-completion, add to ~/.bashrc: source THAT_FILE)
  zsh     forcegrasp completion zsh > ~/.zsh/_forcegrasp
          and in ~/.zshrc:  fpath=(~/.zsh $fpath); autoload -U compinit; compinit
  fish    forcegrasp completion fish > ~/.config/fish/completions/forcegrasp.fish

A new shell then completes forcegrasp tr<TAB>, forcegrasp train exp<TAB>, forcegrasp evaluate 'policies=[no_<TAB>
"""
#: Names that need torch to be asked for; a test holds them against forcegrasp.controllers.
CONTROLLERS = ("close", "force_pi", "informed", "nothing")
#: In a row of the table: files, too; and several values as in [a,b].
FILES, SEVERAL = "@", ","


def run(arguments: list[str]) -> None:
    """Runs the verb."""
    if len(arguments) != 1:
        raise ConfigError(f"which shell? forcegrasp completion {'|'.join(SHELLS)}")
    if arguments[0] not in SHELLS:
        raise ConfigError(f"no completion for {arguments[0]!r}{closest(arguments[0], SHELLS)}")
    print(script(arguments[0]), end="")


def script(shell: str) -> str:
    """The shell's script; ``forcegrasp/cli/completion.SHELL`` with what can be completed in it."""
    from forcegrasp.cli.verbs import VERBS

    template = (files("forcegrasp.cli") / f"completion.{shell}").read_text("utf-8")
    verbs = "\n".join(f"{verb.name}:{verb.purpose.replace(':', ',')}" for verb in VERBS.values())
    rows = "\n".join(" ".join(row) for row in table())
    return template.replace("@VERBS@", verbs.replace("'", "'\\''")).replace("@TABLE@", rows)


def table() -> Iterator[list[str]]:
    """Rows ``VERB KEY VALUE ...``: what may follow ``KEY=``, or stand alone after the verb where the key is ``-``."""
    from forcegrasp.cli.options import HYDRA_OPTIONS, LAUNCHERS, groups, leaves
    from forcegrasp.cli.verbs import VERBS
    from forcegrasp.effects import catalogue
    from forcegrasp.models.model_file import SHIPPED
    from forcegrasp.physics import shipped_grippers
    from forcegrasp.policies import shipped_policies

    policies, effects = [*shipped_policies(), *CONTROLLERS, FILES], list(catalogue())
    named = {
        **dict.fromkeys(("policies", "baseline", "run"), policies),
        **dict.fromkeys(("effects", "effect"), effects),
        "gripper": [*shipped_grippers(), FILES],
        "model": [SHIPPED, FILES],
        "objects": ["paper", FILES],
        "shell": list(SHELLS),
    }
    for verb in VERBS.values():
        option, _ = verb.positional
        flags = ["--help", *(["--all"] if verb.schema else []), *(["-m"] if verb.multirun else [])]
        yield [verb.name, "-", *flags, *(named.get(option, [FILES]) if option else [])]
        for name, entry, _ in leaves(verb.schema) if verb.schema else []:
            kind, choices = str(entry.type), entry.metadata["choices"]
            values = choices or {"bool": ["true", "false"]}.get(kind, [])
            if "str" in kind and not choices:
                values = named.get(name, [FILES])
            yield [verb.name, name, *([SEVERAL] if kind.startswith("list") else []), *values]
        for group, choices in (groups(verb.name) if verb.schema else {}).items():
            yield [verb.name, group, *choices]
    yield ["effects", "gripper", *named["gripper"]]
    yield ["render", "policy", *policies]
    yield ["train", "resume", FILES]
    yield ["train", "hydra/launcher", *LAUNCHERS]
    for name in HYDRA_OPTIONS:
        yield ["train", name, *([FILES] if name.endswith(".dir") else [])]


VERB = Verb(
    "completion",
    "print a script that completes verbs, options and values in bash, zsh or fish",
    run=run,
    notes=NOTES,
    positional=("shell", "|".join(SHELLS)),
)
