"""Scenes (MJCF) of grippers that read other files, or ask for more memory than there is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from forcegrasp.physics.gripper import shipped_folder
from forcegrasp.physics.gripper_file import load_gripper
from tools.reliability.attacks.attack import Attack, not_files, replace


def _scene(before: str = "", within: str = "") -> str:
    """The shipped scene with something before its world, and something in it."""
    text = (shipped_folder() / "tiago.xml").read_text()
    return text.replace("<worldbody>", f"{before}\n<worldbody>\n{within}", 1)


def _nested(tag: str, depth: int) -> str:
    return f"<{tag}>" * depth + "<geom size='1'/>" + f"</{tag}>" * depth


ENTITIES = (
    '<!DOCTYPE x [<!ENTITY a "lol">'
    + "".join(f'<!ENTITY {chr(98 + n)} "{f"&{chr(97 + n)};" * 10}">' for n in range(10))
    + "]>"
)
SCENES: dict[str, Callable[[], str]] = {
    "an include of /etc/passwd": lambda: _scene("<include file='/etc/passwd'/>"),
    "an include of the outside": lambda: _scene("<include file='../outside/secret'/>"),
    "an include of itself": lambda: _scene("<include file='scene.xml'/>"),
    "an include of a device": lambda: _scene("<include file='/dev/zero'/>"),
    "an include of a pipe": lambda: _scene("<include file='pipe'/>"),
    "a mesh from a device": lambda: _scene("<asset><mesh name='m' file='/dev/zero'/></asset>"),
    "a mesh from the outside": lambda: _scene("<asset><mesh name='m' file='../outside/secret'/></asset>"),
    "a texture from a device": lambda: _scene("<asset><texture type='2d' name='t' file='/dev/zero'/></asset>"),
    "a height field from a device": lambda: _scene("<asset><hfield name='h' file='/dev/zero' size='1 1 1 1'/></asset>"),
    "a skin from a device": lambda: _scene("<asset><skin name='s' file='/dev/zero'/></asset>"),
    "a billion copies": lambda: _scene("", "<replicate count='1000000000'><geom size='1'/></replicate>"),
    "copies of copies": lambda: _scene("", "<replicate count='1000'>" * 4 + "<geom size='1'/>" + "</replicate>" * 4),
    "a texture of 10¹² pixels": lambda: _scene(
        "<asset><texture name='t' type='2d' builtin='flat' width='1000000' height='1000000'/></asset>"
    ),
    "a height field of 10¹⁰ points": lambda: _scene(
        "<asset><hfield name='h' nrow='100000' ncol='100000' size='1 1 1 1'/></asset>"
    ),
    "an arena of a terabyte": lambda: _scene("<size memory='1T'/>"),
    "a million user numbers": lambda: _scene("<size nuser_geom='1000000000'/>"),
    "a composite of a billion": lambda: _scene(
        "", "<body><flexcomp name='f' type='grid' dim='3' count='1000 1000 1000' spacing='1 1 1'/></body>"
    ),
    "bodies in bodies": lambda: _scene("", _nested("body", 50_000)),
    "a file of 50 MB": lambda: _scene("<!--" + "x" * 50_000_000 + "-->"),
    "entities of entities": lambda: ENTITIES + "<mujoco model='&k;'/>",
    "an outside entity": lambda: "<!DOCTYPE x [<!ENTITY e SYSTEM 'file:///etc/passwd'>]><mujoco model='&e;'/>",
    "an unknown plugin": lambda: _scene("<extension><plugin plugin='evil.so'/></extension>"),
    "no number": lambda: _scene("<option timestep='nan'/>"),
    "no time": lambda: _scene("<option timestep='0'/>"),
    "no XML": lambda: "\0" * 1000,
    "another format": lambda: "<robot name='x'/>",
}


def attacks() -> Iterator[Attack]:
    for name, scene in SCENES.items():
        yield Attack(name, partial(_gripper, scene), lambda: load_gripper("./gripper.yaml"), seconds=10)
    for name, make in not_files():
        yield Attack(f"the scene is {name}", partial(_no_scene, make), lambda: load_gripper("./gripper.yaml"))
    for path in ("/etc/passwd", "../outside/secret", "/dev/zero", "pipe", "x" * 5000):
        yield Attack(f"model: {path[:40]}", partial(_gripper, str, path), lambda: load_gripper("./gripper.yaml"))


def _gripper(scene: Callable[[], str], model: str = "scene.xml") -> None:
    import os

    text = (shipped_folder() / "tiago.yaml").read_text()
    assert "model: tiago.xml" in text
    Path("gripper.yaml").write_text(text.replace("model: tiago.xml", f"model: {model}"))
    Path("scene.xml").write_text(scene())
    os.mkfifo("pipe")


def _no_scene(make: Callable[[Path], object]) -> None:
    _gripper(str)
    replace(Path("scene.xml"), make)
