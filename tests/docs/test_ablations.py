"""The page on ablations names all presets, and the files that it tells to write set what there is."""

from __future__ import annotations

import yaml
from doc_pages import PAGES, ROOT, blocks

from forcegrasp.cli.options import compose

PAGE = PAGES["docs/ablations.md"]


def test_every_experiment_of_the_presets_is_explained():
    for path in (ROOT / "conf" / "sweep").glob("*.yaml"):
        params = (yaml.safe_load(path.read_text()) or {}).get("hydra", {}).get("sweeper", {}).get("params", {})
        for name in params.get("experiment", "ib").split(","):
            assert f"`{name}`" in PAGE


def test_files_of_the_page_set_what_there_is():
    first, second, sweep = (yaml.safe_load(block.code) for block in blocks("docs/ablations.md", "yaml"))
    parts = ",".join(first["observation"]["parts"])
    assert compose("train", [f"observation.parts=[{parts}]"]).observation.parts == first["observation"]["parts"]
    compose("train", ["experiment=no_ib", f"grasp.kappa={second['grasp']['kappa']}"])
    assert next(iter(sweep["hydra"]["sweeper"]["params"])) == "seed"
