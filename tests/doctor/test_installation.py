"""Code that is not what is installed, and files that are missing."""

from __future__ import annotations

import json

import pytest

from forcegrasp.doctor import installation
from forcegrasp.doctor.installation import check_data, check_installation


@pytest.fixture
def checkout(environment, tmp_path, monkeypatch):
    """forcegrasp as installed from a checkout, to be edited."""
    import forcegrasp

    (tmp_path / "forcegrasp").mkdir()
    monkeypatch.setattr(forcegrasp, "__file__", str(tmp_path / "forcegrasp" / "__init__.py"))
    found = environment["forcegrasp"]
    found.origin = json.dumps({"url": tmp_path.as_uri(), "dir_info": {"editable": True}})
    found.requires, found.version = ["numpy >= 2.0", 'pytest; extra == "dev"'], forcegrasp.__version__
    (tmp_path / "pyproject.toml").write_text('[project]\ndependencies = ["numpy>=2.0"]\n')
    return found


def test_sound(checkout, told):
    told(check_installation, "fine")


def test_sound_without_a_checkout(checkout, told, tmp_path):
    checkout.origin, checkout.home = None, tmp_path
    (tmp_path / "pyproject.toml").unlink()
    told(check_installation, "fine")


def test_not_installed(environment, told):
    del environment["forcegrasp"]
    assert "without being installed" in told(check_installation, "mend")


def test_another_copy_runs(checkout, told, tmp_path):
    checkout.origin = json.dumps({"url": (tmp_path / "other").as_uri(), "dir_info": {"editable": True}})
    assert "other is installed, but" in told(check_installation, "mend")


def test_another_version_runs(checkout, told):
    checkout.version = "0.0.9"
    assert "is installed as 0.0.9; install it again" in told(check_installation, "mend")


def test_pyproject_has_changed_since(checkout, told, tmp_path):
    (tmp_path / "pyproject.toml").write_text('[project]\ndependencies = ["numpy>=2.0", "polars>=1.30"]\n')
    assert "has changed since it was installed (polars>=1.30); make setup" in told(check_installation, "warning")


def files_of(tmp_path, *left_out: str):
    for package, names in {**installation.needed_files(), "policies": ("mine/config.yaml",)}.items():
        for name in names:
            path = tmp_path / package / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if f"{package}/{name}" not in left_out:
                path.touch()
    return lambda package: tmp_path / package.removeprefix("forcegrasp.")


def test_all_files(told, tmp_path, monkeypatch):
    monkeypatch.setattr(installation, "files", files_of(tmp_path))
    assert "trained policies: mine" in told(check_data, "fine")


@pytest.mark.parametrize(
    "lost", ["conf/train.yaml", "assets/franka_hand.xml", "assets/known_grasps.json", "reports/report.html"]
)
def test_a_file_is_missing(lost, told, tmp_path, monkeypatch):
    monkeypatch.setattr(installation, "files", files_of(tmp_path, lost))
    assert f"missing in the package: {lost}; install it again" in told(check_data, "mend")


def test_a_folder_is_missing(told, tmp_path, monkeypatch):
    folder = files_of(tmp_path)

    def without_conf(package):
        if package == "forcegrasp.conf":
            raise ModuleNotFoundError(package)
        return folder(package)

    monkeypatch.setattr(installation, "files", without_conf)
    assert "conf/train.yaml, conf/evaluate.yaml" in told(check_data, "mend")


def test_no_policies(told, tmp_path, monkeypatch):
    monkeypatch.setattr(installation, "files", files_of(tmp_path, "policies/mine/config.yaml"))
    assert "no trained policy" in told(check_data, "warning")


def test_this_installation_has_its_files():
    assert not [finding for finding in check_data() if finding.level == "mend"]
