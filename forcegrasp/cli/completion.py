"""``forcegrasp completion``: a script with which a shell completes verbs, options, presets, effects and policies.

All that can be completed is written into the script, so that no Python starts when a key is pressed.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import files

from forcegrasp.errors import ConfigError, closest

PURPOSE = "print a script that completes verbs, options and values in bash, zsh or fish"
SHELLS = ("bash", "zsh", "fish")
HELP = f"""forcegrasp completion: {PURPOSE}

usage: forcegrasp completion [{"|".join(SHELLS)}]

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


def main(arguments: list[str]) -> int:
    """Runs the verb; returns the exit status."""
    if {"-h", "--help"} & set(arguments):
        print(HELP, end="")
        return 0
    if len(arguments) != 1:
        raise ConfigError(f"which shell? forcegrasp completion {'|'.join(SHELLS)}")
    if arguments[0] not in SHELLS:
        raise ConfigError(f"no completion for {arguments[0]!r}{closest(arguments[0], SHELLS)}")
    print(script(arguments[0]), end="")
    return 0


def script(shell: str) -> str:
    """The shell's script; ``forcegrasp/cli/completion.SHELL`` with what can be completed in it."""
    from forcegrasp.cli.main import VERBS

    template = (files("forcegrasp.cli") / f"completion.{shell}").read_text("utf-8")
    verbs = "\n".join(f"{verb}:{purpose.replace(':', ',')}" for verb, purpose in VERBS.items())
    rows = "\n".join(" ".join(row) for row in table())
    return template.replace("@VERBS@", verbs.replace("'", "'\\''")).replace("@TABLE@", rows)


def table() -> Iterator[list[str]]:
    """Rows ``VERB KEY VALUE ...``: what may follow ``KEY=``, or stand plainly after the verb where the key is ``-``."""
    from forcegrasp.cli.main import VERBS
    from forcegrasp.cli.options import HYDRA_OPTIONS, LAUNCHERS, SCHEMAS, groups, leaves
    from forcegrasp.effects import catalogue
    from forcegrasp.models.model_file import SHIPPED
    from forcegrasp.policies import shipped_policies

    policies, effects = [*shipped_policies(), *CONTROLLERS, FILES], list(catalogue())
    named = {
        **dict.fromkeys(("policies", "baseline", "run"), policies),
        **dict.fromkeys(("effects", "effect"), effects),
        "gripper": [*shipped_grippers(), FILES],
        "model": [SHIPPED, FILES],
        "objects": ["paper", FILES],
    }
    plain = {"effects": effects, "export": policies, "completion": list(SHELLS)}
    for verb in VERBS:
        flags = ["--help", *(["--all"] if verb in SCHEMAS else []), *(["-m"] if verb == "train" else [])]
        options = list(leaves(SCHEMAS[verb])) if verb in SCHEMAS else []
        takes_files = [FILES] if {"data", "folders"} & {name for name, _, _ in options} else []
        yield [verb, "-", *flags, *plain.get(verb, takes_files)]
        for name, entry, _ in options:
            kind, choices = str(entry.type), entry.metadata["choices"]
            values = choices or {"bool": ["true", "false"]}.get(kind, [])
            if "str" in kind and not choices:
                values = named.get(name, [FILES])
            yield [verb, name, *([SEVERAL] if kind.startswith("list") else []), *values]
        for group, choices in (groups(verb) if verb in SCHEMAS else {}).items():
            yield [verb, group, *choices]
    yield ["render", "policy", *policies]
    yield ["train", "resume", FILES]
    yield ["train", "hydra/launcher", *LAUNCHERS]
    for name in HYDRA_OPTIONS:
        yield ["train", name, *([FILES] if name.endswith(".dir") else [])]


def shipped_grippers() -> list[str]:
    """Names of the grippers that come with the package: a description beside its scene."""
    names = {file.name for file in files("forcegrasp.assets").iterdir()}
    return sorted(name.removesuffix(".yaml") for name in names if name.replace(".yaml", ".xml") in names - {name})
